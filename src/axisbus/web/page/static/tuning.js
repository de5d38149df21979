// The script of the tuning view: requests a trial, keeps it alive while it runs, stores the displayed gains and the trials.
"use strict";
(() => {
  const BEAT = 50, LOOK = 250, WAIT = 5000, UNHEARD = 2000, OLD = 3000, FOUND = 8; // ms, but the last: objects
  const { send, say, ask, reasons, make, put } = window.axisbusPage;
  const objects = window.axisbusObjects, picture = window.axisbusResponse;
  const one = (selector) => document.querySelector(selector);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  let section, who = "", press = 0, asked = null, running = null, waiting = null, before = new Map();
  let gains = {}, books = new Map(), rows = [], last = null, pinned = null;

  // -- the axis and the step ----------------------------------------------------------------------------------------------------
  const axis = () => one("#tune-axis").value;
  const kind = () => one("#tune-kind").value;
  const chosen = () => one("#tune-axis").selectedOptions[0]?.dataset ?? {};
  function labels() {
    const unit = chosen().unit ?? "", position = kind() === "position";
    const words = {
      distance: `Distance in ${unit}, with its sign`,
      velocity: `Velocity in ${unit}/s${position ? "" : ", with its sign"}`,
      acceleration: `Acceleration in ${unit}/s²`, seconds: "Seconds for each side",
    };
    for (const label of all("[data-step]", section)) put(label.firstElementChild, words[label.dataset.step]);
    one("[data-step=distance]").hidden = !position;
  }
  function state(text, bad = false) {
    put(one("#tune-state"), text);
    one("#tune-state").classList.toggle("bad", bad);
    one("#tune-try").disabled = Boolean(waiting || running);
    one("#tune-end").disabled = !running;
    one("#tune-pin").disabled = !last;
    one("#tune-unpin").disabled = !pinned;
  }

  // -- a trial ------------------------------------------------------------------------------------------------------------------
  function told(message) {
    if (send(message)) return true;
    say("failed", "There is no connection: nothing was sent.", "");
    state("");
    return false;
  }
  async function attempt() {
    const fields = all("[data-step]:not([hidden]) input", section);
    const values = Object.fromEntries(fields.map((field) => [field.dataset.value, field.value]));
    press += 1;
    asked = { do: `step_${kind()}`, axis: axis(), values, press, keys: looked().map((gain) => gain.key) };
    before = await readAll(asked.keys);
    state("");
    const { keys, ...message } = asked;
    told(message);
  }
  function begin({ keys, ...message }) {
    press += 1;
    running = { keys, press, since: performance.now(), heard: false };
    state("Starting.");
    if (!told({ ...message, sure: true, press })) running = null;
  }
  // A trial runs only while this page sends keep-alive messages: the server halts it within 0.2 s after the last one.
  function beat() {
    if (!running) return;
    if (!running.heard && performance.now() - running.since > UNHEARD) over("");
    else send({ do: "trial_beat", press: running.press });
  }
  function end() {
    if (running) send({ do: "trial_end" });
  }
  function over(text, bad = false) {
    running = null;
    state(text, bad);
  }
  const WORDS = { asked: "Starting.", there: "Step forward.", back: "Step back." };
  async function take(trial) {
    if (trial.question) {
      const message = asked; // as it was asked for, whatever is typed meanwhile
      if (message?.press !== trial.press) return; // another step was asked for since
      if (!ask(trial.question, () => begin(message))) say("refused", "Nothing moves: another question is open.", "answer it, and try again");
      return;
    }
    if (trial.phase !== "over") {
      if (running) running.heard = true;
      return state(WORDS[trial.phase]);
    }
    const keys = running?.keys ?? [], text = trial.why ? `Disturbed, and not measured: ${trial.why}` : "Measured.";
    over(text, Boolean(trial.why));
    const row = { ...trial, before, after: new Map() };
    rows = [row, ...rows].slice(0, Number(section.dataset.rows));
    table();
    await Promise.all([fetched(trial.number), readAll(keys).then((after) => { row.after = after; table(); })]);
    state(text, Boolean(trial.why));
  }
  async function fetched(number) {
    try {
      last = (await (await fetch(`/trials/${number}`)).json()) ?? last;
      drawn();
    } catch { /* the figures are there without the picture */ }
  }

  // -- gains --------------------------------------------------------------------------------------------------------------------
  const place = () => `axisbus.tuning.${section.dataset.cell}`;
  const looked = () => gains[axis()] ?? [];
  function keep() {
    try { localStorage.setItem(place(), JSON.stringify(gains)); } catch { /* it may not be kept */ }
  }
  function restore() {
    let kept = null;
    try { kept = JSON.parse(localStorage.getItem(place())); } catch { /* none */ }
    const good = (gain) => /^[0-9]{1,3}:[0-9A-F]{4}:[0-9A-F]{2}$/.test(gain?.key) && typeof gain.name === "string";
    const most = Number(section.dataset.gains);
    for (const [of, found] of Object.entries(kept ?? {}))
      if (Array.isArray(found)) gains[of] = found.filter(good).slice(0, most).map(({ key, name }) => ({ key, name }));
  }
  // Reads objects, and returns their values by key; a value that does not arrive in time is unknown.
  function readAll(keys) {
    if (!keys.length) return Promise.resolve(new Map());
    waiting?.done();
    return new Promise((resolve) => {
      const found = new Map(keys.map((key) => [key, "unknown"])), left = new Set(keys);
      const done = () => { clearTimeout(timer); if (waiting?.left === left) waiting = null; resolve(found); };
      const timer = setTimeout(done, WAIT);
      waiting = { left, found, done };
      state("Reading the gains.");
      objects.read(keys);
    });
  }
  function heard(seen) {
    if (!waiting?.left.has(seen.key) || seen.wrote) return;
    waiting.left.delete(seen.key);
    waiting.found.set(seen.key, seen.value ?? `unknown: ${seen.error?.message ?? "it was not reported"}`);
    if (!waiting.left.size) waiting.done();
  }
  async function book(node) {
    if (!books.has(node)) {
      let found;
      try {
        found = await (await fetch(`/objects/${node}`)).json();
      } catch {
        return { error: { message: "The dictionary could not be loaded.", observed: "", remedy: "search again" } };
      }
      if (found.error) return found; // it may be there another time
      books.set(node, found);
    }
    return books.get(node);
  }
  async function search() {
    const text = one("#gain-search").value.trim().toLowerCase(), node = chosen().node;
    if (!text) return shown([], "");
    if (!Number(node)) return shown([], "This axis has no drive.");
    const found = await book(node);
    if (text !== one("#gain-search").value.trim().toLowerCase() || node !== chosen().node) return;
    if (found.error) return shown([], reasons(found.error));
    const address = /^(?:0x)?([0-9a-f]{1,4})h?(?::([0-9a-f]{1,2})h?)?$/.exec(text), words = text.split(/\s+/);
    const named = (name) => words.every((word) => name.toLowerCase().includes(word));
    const gain = (object, { key, name }) => ({ key, name: object.record ? `${object.name}: ${name}` : name });
    const matches = ({ key, name }) => {
      const [, index, sub] = key.toLowerCase().split(":"), wanted = address?.[2];
      if (named(name)) return true;
      return address && index.startsWith(address[1]) && (!wanted || parseInt(sub, 16) === parseInt(wanted, 16));
    };
    const readable = (object) => object.entries.filter((entry) => entry.reads).map((entry) => gain(object, entry));
    const fits = found.objects.flatMap(readable).filter(matches);
    const more = fits.length > FOUND ? `${fits.length} objects; the first ${FOUND}` : "";
    shown(fits.slice(0, FOUND), fits.length ? more : "No object found.");
  }
  function shown(found, text) {
    put(one("#gain-state"), text);
    one("#gains-found").replaceChildren(...found.map((gain) => {
      const item = make("li", ""), row = make("div", "", "row");
      row.append(make("code", spelt(gain.key)), make("span", gain.name, "name"), button("Add", `Add ${gain.name}`, () => add(gain)));
      item.append(row);
      return item;
    }));
  }
  const spelt = (key) => key.split(":").slice(1).join("h:");
  function button(text, label, act) {
    const made = make("button", text);
    made.type = "button";
    made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    return made;
  }
  function add(gain) {
    const most = Number(section.dataset.gains);
    if (looked().some((each) => each.key === gain.key)) return;
    if (looked().length >= most) return say("refused", `${most} objects are already shown`, "remove one of them");
    gains[axis()] = [...looked(), gain];
    keep();
    list();
    objects.read([gain.key]);
    one("#gain-search").value = "";
    shown([], "");
    one("#gain-search").focus();
  }
  function list() {
    one("#gains").replaceChildren(...looked().map((gain) => {
      const item = make("li", ""), head = make("div", "", "row"), hand = make("div", "", "row"), said = make("p", "", "said");
      const value = make("output", "", "live"), age = make("span", "", "age"), field = document.createElement("input");
      value.dataset.gain = age.dataset.gainAge = said.dataset.gainSaid = gain.key;
      said.setAttribute("role", "status");
      Object.assign(field, { type: "text", autocomplete: "off", spellcheck: false, maxLength: 1000 });
      field.dataset.gainWrites = gain.key;
      field.setAttribute("aria-label", `Value to write to ${gain.name}`);
      const write = () => objects.write(gain.key, field.value.trim(), "");
      field.addEventListener("keydown", (event) => { if (event.key === "Enter") write(); });
      const read = () => objects.read([gain.key]);
      head.append(make("code", spelt(gain.key)), make("span", gain.name, "name"), value, age);
      hand.append(field, button("Write", `Write ${gain.name}`, write), button("Read", `Read ${gain.name}`, read));
      hand.append(button("Remove", `Remove ${gain.name} from the list`, () => away(gain.key)));
      item.append(head, hand, said);
      return item;
    }));
    paint();
  }
  function away(key) {
    gains[axis()] = looked().filter((gain) => gain.key !== key);
    keep();
    list();
    one("#gain-search").focus();
  }
  const words = (ms) => (ms < 100_000 ? `${(ms / 1000).toFixed(1)} s` : `${Math.round(ms / 60_000)} min`);
  function paint() {
    const now = performance.now();
    for (const value of all("[data-gain]", section)) {
      const known = objects.values.get(value.dataset.gain), there = known && known.value !== null;
      put(value, there ? known.value : "unknown");
      value.classList.toggle("unknown", !there);
      value.classList.toggle("aged", Boolean(there) && now - known.at > OLD);
      put(value.nextElementSibling, there ? words(now - known.at) : "");
    }
    for (const said of all("[data-gain-said]", section)) {
      const known = objects.values.get(said.dataset.gainSaid);
      put(said, [known?.error && reasons(known.error), known?.wrote?.text].filter(Boolean).join("\n"));
      said.classList.toggle("bad", Boolean(known?.error || known?.wrote?.bad));
    }
  }

  // -- result ------------------------------------------------------------------------------------------------------------------
  function table() {
    const figures = one("#trials").dataset.figures.split(" ");
    const titles = all("th", one("#trials").parentElement.querySelector("thead")).map((title) => title.textContent);
    one("#trials").replaceChildren(...rows.map((row) => {
      const line = make("tr", "", row.why ? "disturbed" : ""), head = make("th", `${row.number}: ${row.axis}\n${row.text}`);
      head.scope = "row";
      const cells = row.why ? [make("td", disturbed(row))] : figures.map((name) => make("td", sides(row, name)));
      if (row.why) cells[0].colSpan = figures.length;
      cells.push(make("td", gainsOf(row.before)), make("td", gainsOf(row.after)));
      line.append(head, ...cells);
      const names = row.why ? ["Trial", "Result", ...titles.slice(-2)] : titles;
      [...line.children].forEach((cell, n) => { cell.dataset.title = names[n]; });
      return line;
    }));
  }
  const disturbed = ({ why, error }) => `disturbed, not measured: ${why}\n${reasons(error && { ...error, message: "" })}`.trim();
  const sides = (row, name) => ["there", "back"].map((side) => `${side} ${row.figures[side][name]}`).join("\n");
  const gainsOf = (values) => [...values].map(([key, value]) => `${spelt(key)}: ${value}`).join("\n") || "none";
  function drawn() {
    if (!section || section.hidden) return;
    const same = pinned && last && pinned.unit === last.unit;
    picture.draw(one("#response"), last, same || !last ? pinned : null);
    const of = (trial) => `trial ${trial.number} of ${trial.axis}, ${trial.text}`;
    const both = [last && `The last: ${of(last)}.`, pinned && `Pinned: ${of(pinned)}.`].filter(Boolean);
    one("#response").setAttribute("aria-label", both.length ? `${both.join(" ")} The table has the figures.` : "No trial yet");
  }
  function pin(trial) {
    pinned = trial;
    drawn();
    state(one("#tune-state").textContent, one("#tune-state").classList.contains("bad"));
  }

  // -- hands --------------------------------------------------------------------------------------------------------------------
  function changed() {
    labels();
    list();
    shown([], "");
    one("#gain-search").value = "";
  }
  function hands() {
    one("#tune-axis").addEventListener("change", changed);
    one("#tune-kind").addEventListener("change", labels);
    one("#tune-try").addEventListener("click", attempt);
    one("#tune-end").addEventListener("click", end);
    one("#tune-pin").addEventListener("click", () => pin(last));
    one("#tune-unpin").addEventListener("click", () => pin(null));
    one("#gain-search").addEventListener("input", search);
    document.addEventListener("visibilitychange", () => document.hidden && end());
    addEventListener("pagehide", end);
    addEventListener("resize", drawn);
    addEventListener("hashchange", () => setTimeout(drawn));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawn);
  }
  document.addEventListener("axisbus-own", ({ detail: own }) => {
    if (!section) return;
    if (own.who !== who) { // another connection, whose trial none is: the one before was halted with it
      if (running) over("Disturbed, and not measured: the connection was lost, which halts the axis.", true);
      who = own.who;
    }
    own.objects.forEach(heard);
    if (running && !running.heard && own.told.some((each) => each.kind === "refused")) over("");
    if (own.trial) take(own.trial);
    if (own.objects.length) paint();
  });
  const mounted = setInterval(() => {
    section = one("main > section[data-view=tuning]");
    if (!section || !one("#trials")) return;
    clearInterval(mounted);
    restore();
    hands();
    changed();
    state(one("#tune-axis").value ? "" : "This cell has no axis.");
    drawn();
    setInterval(beat, BEAT);
    setInterval(() => section.hidden || paint(), LOOK);
  }, 20);
})();
