// The script of the objects view: the dictionary of a node as a tree, values with their ages, writing, PDOs, findings, verification.
"use strict";
(() => {
  const LOOK = 250, OLD = 3000, SHOWN = 400; // ms, ms, objects
  const { send, say, ask, reasons, make, put, table } = window.axisbusPage;
  const one = (selector, within = document) => within.querySelector(selector);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  let section, book = null, wanted = 0, who = "", part = "dictionary", kept = [], sent = "", opened = new Set(), verified = null;
  const values = new Map(), entries = new Map(), typed = new Map(); // by key: last value, dictionary entry, value being typed

  // -- the book of a node -----------------------------------------------------------------------------------------------------
  async function load(node) {
    wanted = node;
    book = null;
    opened = new Set();
    show();
    put(one("#objects-state"), "Loading the dictionary …");
    let found;
    try {
      const answer = await fetch(`/objects/${node}`);
      found = await answer.json();
    } catch {
      found = { error: { message: "The dictionary could not be loaded.", observed: "", remedy: "choose the node again" } };
    }
    if (node !== wanted) return;
    book = found;
    for (const object of found.objects ?? [])
      for (const entry of object.entries) entries.set(entry.key, { ...entry, object });
    show();
  }
  function show() {
    const error = book?.error;
    put(one("#objects-error"), reasons(error));
    if (book) put(one("#objects-state"), error ? "" : `${book.objects.length} objects by ${book.file}`);
    for (const button of all("[data-part]", section)) {
      button.setAttribute("aria-pressed", String(button.dataset.part === part));
      one(`#part-${button.dataset.part}`).hidden = button.dataset.part !== part || !book || Boolean(error);
    }
    if (!book || error) return;
    if (part === "dictionary") tree();
    if (part === "pdos") one("#part-pdos").replaceChildren(...book.pdos.map(pdo));
    if (part === "findings") findings();
    if (part === "verify") verification();
  }

  // -- search -------------------------------------------------------------------------------------------------------------------
  function sought() {
    const text = one("#object-search").value.trim().toLowerCase(), mapped = one("#in-pdos").checked;
    const address = /^(?:0x)?([0-9a-f]{1,4})h?(?::[0-9a-f]{1,2}h?)?$/.exec(text), words = text.split(/\s+/);
    const named = (name) => words.every((word) => name.toLowerCase().includes(word));
    return book.objects.filter((object) => {
      if (mapped && !object.entries.some((entry) => entry.pdo)) return false;
      if (!text || (address && object.index.toLowerCase().startsWith(address[1]))) return true;
      return named(object.name) || object.entries.some((entry) => named(`${object.name} ${entry.name}`));
    });
  }
  function tree() {
    const found = sought();
    put(one("#objects-state"), `${found.length} of ${book.objects.length} objects by ${book.file}`);
    const lines = found.slice(0, SHOWN).map(line);
    if (found.length > SHOWN) lines.push(make("li", `and ${found.length - SHOWN} more: search for them`, "hint"));
    one("#tree").replaceChildren(...lines);
    const first = one(".branch", one("#tree"));
    if (first) first.tabIndex = 0;
    paint();
  }

  // -- one object -----------------------------------------------------------------------------------------------------------------
  function line(object) {
    const item = make("li", ""), head = make("button", "", "branch");
    head.type = "button";
    head.tabIndex = -1;
    head.dataset.index = object.index;
    head.append(make("code", `${object.index}h`), make("span", object.name, "name"));
    if (object.record) head.append(make("small", `${object.kind}, ${object.entries.length} entries`));
    else if (object.entries[0]) head.append(output(object.entries[0].key));
    item.append(head);
    unfold(item, object, opened.has(object.index));
    return item;
  }
  function unfold(item, object, open) {
    item.firstChild.setAttribute("aria-expanded", String(open));
    while (item.children.length > 1) item.lastChild.remove();
    opened[open ? "add" : "delete"](object.index);
    if (!open) return;
    const body = make("div", "", "entries");
    const readable = object.entries.filter((entry) => entry.reads).slice(0, Number(section.dataset.asked));
    if (object.record && readable.length) body.append(button("Read all", () => read(readable.map((entry) => entry.key))));
    body.append(...object.entries.map((entry) => leaf(object, entry)));
    item.append(body);
    paint();
  }
  function leaf(object, entry) {
    const block = make("div", "", "entry");
    const facts = [entry.type, entry.access, entry.pdo ? `may be mapped in ${entry.pdo}` : "cannot be mapped",
      entry.limits && `limits ${entry.limits}`, entry.default && `default ${entry.default}`, entry.unit && `in ${entry.unit}`, entry.carried && `travels in ${entry.carried}`];
    const what = make("div", "", "what");
    if (object.record) what.append(make("code", entry.sub), make("span", entry.name, "name"));
    what.append(make("small", facts.filter(Boolean).join(" · ")));
    for (const note of entry.notes) what.append(make("small", note, "warned"));
    block.append(what);
    const hand = make("div", "", "row");
    if (entry.reads) {
      hand.append(age(output(entry.key, "now"), entry.key), button("Read", () => read([entry.key])));
      const keep = button("Keep reading", () => keepReading(entry.key));
      keep.dataset.keeps = entry.key;
      hand.append(keep);
    }
    if (entry.writes) hand.append(...writing(entry));
    block.append(hand);
    const told = make("p", "", "said");
    told.dataset.said = entry.key;
    told.setAttribute("role", "status");
    block.append(told);
    return block;
  }
  function writing(entry) {
    const field = document.createElement("input");
    field.type = "text";
    field.autocomplete = "off";
    field.spellcheck = false;
    field.maxLength = 1000;
    field.placeholder = entry.unit ? `value, or with ${entry.unit}` : "value";
    field.setAttribute("aria-label", `Value to write to ${entry.key.split(":").slice(1).join(":")} ${entry.name}`);
    field.dataset.writes = entry.key;
    const go = () => write(entry.key, field.value.trim(), "");
    field.addEventListener("keydown", (event) => { if (event.key === "Enter") go(); });
    return [field, button("Write", go)];
  }
  function button(text, act) {
    const made = make("button", text);
    made.type = "button";
    made.addEventListener("click", act);
    return made;
  }
  function output(key, classes = "") {
    const made = make("output", "", `live ${classes}`);
    made.dataset.of = key;
    return made;
  }
  function age(value, key) {
    const both = make("span", "", "aged-value"), of = make("span", "", "age");
    of.dataset.age = key;
    both.append(value, of);
    return both;
  }

  // -- out ------------------------------------------------------------------------------------------------------------------------
  function told(message) {
    if (!send(message)) say("failed", "There is no connection: nothing was sent.", "");
  }
  const read = (keys) => told({ do: "read_objects", objects: keys });
  function write(key, text, agreed) {
    typed.set(key, text);
    told({ do: "write_object", objects: [key], text, values: { agreed } });
  }
  function keepReading(key) {
    const most = Number(section.dataset.kept);
    if (kept.includes(key)) kept = kept.filter((each) => each !== key);
    else if (kept.length < most) kept = [...kept, key];
    else return say("refused", `${most} objects are already being read repeatedly`, "stop reading one of them");
    keptRows();
    tellKept();
  }
  // While they are not visible, they are not read.
  function tellKept() {
    const keys = section.hidden || document.hidden ? [] : kept, text = JSON.stringify(keys);
    if (text !== sent && send({ do: "keep_reading", objects: keys })) sent = text;
  }
  function keptRows() {
    one("#kept").hidden = !kept.length;
    one("#kept-rows").replaceChildren(...kept.map((key) => {
      const row = make("tr", ""), entry = entries.get(key), [node, index, sub] = key.split(":");
      const name = entry.object.record ? `${entry.object.name}: ${entry.name}` : entry.name;
      const title = make("th", `${index}h:${sub}`), value = make("td", ""), of = make("td", "", "age"), end = make("td", "");
      title.scope = "row";
      of.dataset.age = key;
      value.append(output(key));
      const over = button("End", () => { keepReading(key); (one("#kept button") ?? one("#object-search")).focus(); });
      over.setAttribute("aria-label", `End reading ${name}`);
      end.append(over);
      row.append(title, make("td", `node ${node}, ${name}`), value, of, end);
      return row;
    }));
    paint();
  }

  // -- in -------------------------------------------------------------------------------------------------------------------------
  function take(seen) {
    const known = values.get(seen.key) ?? { value: null, at: 0, error: null, wrote: null };
    if (seen.question) {
      const text = typed.get(seen.key) ?? "";
      const open = ask(seen.question.text, () => write(seen.key, text, seen.question.reasons));
      if (!open) say("refused", "Nothing was written: another question is open.", "answer it, and write again");
      return;
    }
    if (seen.value !== null) Object.assign(known, { value: seen.value, at: performance.now() - 1000 * seen.age });
    if (seen.wrote) known.wrote = { text: seen.error ? reasons(seen.error) : seen.note, bad: Boolean(seen.error) };
    else known.error = seen.error;
    values.set(seen.key, known);
  }
  const words = (ms) => (ms < 10_000 ? `${(ms / 1000).toFixed(1)} s` : ms < 100_000 ? `${Math.round(ms / 1000)} s` : `${Math.round(ms / 60_000)} min`);
  function paint() {
    const now = performance.now();
    for (const node of all("[data-of]", section)) {
      const known = values.get(node.dataset.of), there = known && known.value !== null;
      put(node, there ? known.value : node.classList.contains("now") ? "unknown" : "");
      node.classList.toggle("unknown", !there);
      node.classList.toggle("aged", Boolean(there) && now - known.at > OLD);
    }
    for (const node of all("[data-age]", section)) {
      const known = values.get(node.dataset.age);
      put(node, known && known.value !== null ? words(now - known.at) : "");
    }
    for (const node of all("[data-said]", section)) {
      const known = values.get(node.dataset.said), wrote = known?.wrote;
      put(node, [known?.error && reasons(known.error), wrote?.text].filter(Boolean).join("\n"));
      node.classList.toggle("bad", Boolean(known?.error || wrote?.bad));
    }
    for (const node of all("[data-keeps]", section)) node.setAttribute("aria-pressed", String(kept.includes(node.dataset.keeps)));
  }

  // -- PDOs -----------------------------------------------------------------------------------------------------------------------
  function pdo(each) {
    const card = make("div", "", each.used ? "pdo" : "pdo unused"), head = make("h2", each.name);
    head.append(make("small", each.heading));
    card.append(head, make("p", each.source, "hint"));
    if (each.slots.length) card.append(bytes(each), slots(each));
    else card.append(make("p", "No object is mapped.", "hint"));
    for (const note of each.notes) card.append(make("p", `note: ${note}`, "hint"));
    return card;
  }
  function bytes(each) {
    const grid = make("div", "", "bytes");
    grid.setAttribute("aria-hidden", "true"); // the list below says the same
    for (let n = 0; n < 8; n += 1) {
      const title = make("span", String(n), "byte");
      title.style.gridColumn = `${8 * n + 1} / span 8`;
      grid.append(title);
    }
    for (const slot of each.slots) {
      if (slot.first + slot.bits > 64 || !slot.bits) continue;
      const box = make("span", slot.bits < 8 ? "" : slot.address, "slot");
      if (slot.bits >= 16) box.append(make("small", slot.name));
      box.title = `${slot.where}: ${slot.address} ${slot.name}`;
      box.style.gridColumn = `${slot.first + 1} / span ${slot.bits}`;
      grid.append(box);
    }
    return grid;
  }
  function slots(each) {
    const list = make("ul", "", "plain legend");
    for (const slot of each.slots) {
      const item = make("li", "");
      item.append(make("span", slot.where, "where"), make("code", slot.address), make("span", slot.name, "name"), make("small", slot.type));
      list.append(item);
    }
    return list;
  }

  // -- findings and verification ----------------------------------------------------------------------------------------------------
  const graded = (texts) => `grade-${texts[0]}`;
  function findings() {
    const { all: count, shown, error } = book.findings, place = one("#part-findings");
    if (error) return place.replaceChildren(make("pre", reasons(error), "error"));
    if (!count) return place.replaceChildren(make("p", "None: axisbus eds check has no findings for this file."));
    const rows = shown.map((each) => [each.severity, each.rule, each.index && `${each.index}h`, each.message, each.remedy, each.line ? String(each.line) : ""]);
    const more = count > shown.length ? `The first ${shown.length} of ${count}; all: axisbus eds check` : `${count} in all, by axisbus eds check`;
    place.replaceChildren(make("p", more, "hint"), table(["Severity", "Rule", "Object", "Finding", "Remedy", "Line"], rows, graded));
  }
  function verification() {
    const at = verified, mine = at && at.node === wanted, runs = Boolean(at && !at.over), bar = one("#verify-bar");
    one("#verify").disabled = runs;
    one("#verify-end").disabled = !runs;
    bar.max = (mine && at.whole) || 1;
    bar.value = mine ? at.done : 0;
    const far = at && `node ${at.node}: ${at.done} of ${at.whole || "?"} entries`;
    put(one("#verify-state"), !at ? "Not verified yet." : runs ? far : mine ? at.text || far : "This node has not been verified yet.");
    put(one("#verify-error"), mine && at.error ? reasons(at.error) : "");
    const rows = mine ? at.differences.map((each) => [each.severity, each.kind, `${each.index}h:${each.subindex}`, each.name, each.message]) : [];
    one("#differences").replaceChildren(...(rows.length ? [table(["Severity", "What", "Object", "Name", "The drive"], rows, graded)] : []));
  }

  // -- hands ------------------------------------------------------------------------------------------------------------------------
  function walk(event) {
    const head = event.target.closest?.(".branch");
    if (!head) return;
    const heads = all("#tree .branch", section), at = heads.indexOf(head), open = head.getAttribute("aria-expanded") === "true";
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: heads.length - 1 }[event.key];
    if (to !== undefined) reach(heads, heads[Math.min(heads.length - 1, Math.max(0, to))]);
    else if ((event.key === "ArrowRight" && !open) || (event.key === "ArrowLeft" && open)) head.click();
    else return;
    event.preventDefault();
  }
  function reach(heads, head) {
    for (const each of heads) each.tabIndex = each === head ? 0 : -1;
    head.focus();
  }
  function hands() {
    one("#object-node").addEventListener("change", (event) => load(Number(event.target.value)));
    one("#object-search").addEventListener("input", () => book?.objects && tree());
    one("#in-pdos").addEventListener("change", () => book?.objects && tree());
    // The space bar stops the machine, whatever has the focus: the box is ticked by Enter.
    one("#in-pdos").addEventListener("keydown", (event) => { if (event.key === "Enter") event.target.click(); });
    one("#tree").addEventListener("keydown", walk);
    one("#tree").addEventListener("click", (event) => {
      const head = event.target.closest(".branch");
      if (!head) return;
      const object = book.objects.find((each) => each.index === head.dataset.index);
      reach(all("#tree .branch", section), head);
      unfold(head.parentNode, object, head.getAttribute("aria-expanded") !== "true");
    });
    for (const each of all("[data-part]", section)) each.addEventListener("click", () => { part = each.dataset.part; show(); });
    one("#verify").addEventListener("click", () => told({ do: "verify", node: wanted }));
    one("#verify-end").addEventListener("click", () => told({ do: "verify_end" }));
  }
  function look() {
    if (section.hidden) return tellKept();
    const chosen = one("#object-node").value;
    if (!wanted && chosen) load(Number(chosen));
    tellKept();
    paint();
  }
  window.axisbusObjects = { read, write, values }; // for the scripts of other views

  document.addEventListener("axisbus-own", ({ detail: own }) => {
    if (!section) return;
    if (own.who !== who) [who, sent] = [own.who, ""]; // another connection, which keeps reading nothing yet
    own.objects.forEach(take);
    if (own.objects.length) paint();
    if (own.verified) {
      verified = own.verified;
      if (part === "verify" && book && !book.error) verification();
    }
  });
  const mounted = setInterval(() => {
    section = one("main > section[data-view=objects]");
    if (!section || !one("#object-node") || !one("#verify-bar")) return;
    clearInterval(mounted);
    hands();
    if (!one("#object-node").value) put(one("#objects-state"), "This cell has no node.");
    keptRows();
    show();
    setInterval(look, LOOK);
  }, 20);
})();
