// The page's own script: fills in values, says when they are old, sends what is asked for, and holds the dead-man of a jog.
"use strict";
(() => {
  const GONE = 600, BEAT = 50, IDLE = 250, AGAIN = 1000, OLD_CELL = 3; // ms, but the last: seconds
  let socket = null, heard = -Infinity, press = 0, held = null, asked = null;
  let command = { ours: true, by: "" };
  const one = (selector, within = document) => within.querySelector(selector);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const open = () => socket !== null && socket.readyState === WebSocket.OPEN;
  const isText = (node) => (node instanceof HTMLInputElement && node.type === "text") || node instanceof HTMLTextAreaElement;

  // -- out ---------------------------------------------------------------------------------------------------------------
  function send(message) {
    if (!open()) return false;
    socket.send(JSON.stringify({ ...message, sent: performance.now() / 1000 }));
    return true;
  }
  function quickStop() {
    release();
    if (!send({ do: "quick_stop_all" })) fetch("/stop", { method: "POST", keepalive: true }).catch(() => {});
  }
  const axisOf = (node) => node.closest("section[data-axis]")?.dataset.axis ?? "";
  const sectionOf = (name) => all("section[data-axis]").find((section) => section.dataset.axis === name);
  function valuesOf(node) {
    const found = {}, section = node.closest("section[data-axis]"), own = node.closest("fieldset");
    if (section) for (const field of all("[data-values=ramps] input", section)) found[field.dataset.value] = field.value;
    if (own) for (const field of all("input", own)) found[field.dataset.value] = field.value;
    return found;
  }
  function act(node, sure) {
    const verb = node.dataset.do;
    if (verb === "quick_stop_all") return quickStop();
    const message = { do: verb, axis: axisOf(node), sure };
    if (node.closest("fieldset")) message.values = valuesOf(node);
    if (!send(message)) say("failed", "There is no connection: this was not sent.", "");
  }

  // -- press and hold -----------------------------------------------------------------------------------------------------
  function hold(node) {
    release();
    press += 1;
    held = { axis: axisOf(node), values: { ...valuesOf(node), direction: node.dataset.jog }, press, node };
    node.classList.add("held");
    beat();
  }
  function beat() {
    if (held) send({ do: "jog", axis: held.axis, values: held.values, press: held.press });
  }
  function release() {
    if (!held) return;
    held.node.classList.remove("held");
    held = null;
    send({ do: "jog_end" });
  }
  setInterval(beat, BEAT);
  setInterval(() => held || send({ do: "beat" }), IDLE);

  const jogOf = (event) => event.target instanceof Element && event.target.closest("[data-jog]");
  addEventListener("pointerdown", (event) => {
    const node = jogOf(event);
    if (!node || event.button !== 0) return;
    event.preventDefault();
    node.focus();
    node.setPointerCapture(event.pointerId);
    hold(node);
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "pagehide", "contextmenu", "hashchange"])
    addEventListener(name, release, true);
  addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => document.hidden && release());
  document.addEventListener("focusout", release);

  // -- keys: they come to us before any button has them ----------------------------------------------------------------------
  addEventListener("keydown", (event) => {
    const inText = isText(event.target);
    if (inText ? event.key === "Escape" : event.key === " ") {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) quickStop();
    } else if (event.key === "Enter" && jogOf(event)) {
      event.preventDefault();
      if (!event.repeat) hold(jogOf(event));
    }
  }, true);
  addEventListener("keyup", (event) => {
    if (event.key === " " && !isText(event.target)) {
      event.preventDefault();
      event.stopImmediatePropagation();
    } else if (event.key === "Enter") release();
  }, true);

  // -- buttons --------------------------------------------------------------------------------------------------------------
  document.addEventListener("click", (event) => {
    const node = event.target instanceof Element && event.target.closest("[data-do], #yes, #no");
    if (!node) return;
    const question = one("#question");
    if (!node.dataset.do) {
      question.close();
      if (node.id === "yes" && asked) asked();
      asked = null;
    } else if (node.dataset.question) ask(worded(node), () => act(node, true));
    else act(node, false);
  });
  // A question, with what was typed in the place of a name in braces.
  function worded(node) {
    const typed = valuesOf(node);
    return node.dataset.question.replace(/\{(\w+)\}/g, (_, name) => typed[name] || "?");
  }
  function ask(text, yes) {
    if (one("#question").open) return false; // what is asked must not change under a hand that answers
    asked = yes;
    one("#asked").textContent = text;
    one("#question").showModal();
    return true;
  }

  // -- in -------------------------------------------------------------------------------------------------------------------
  function put(node, text) {
    if (node && node.textContent !== text) node.textContent = text;
  }
  function make(name, text, classes = "") {
    const node = document.createElement(name);
    node.textContent = text;
    node.className = classes;
    return node;
  }
  function table(titles, rows, classes = () => "") {
    const made = make("table", "", "stacks"), head = make("tr", ""), body = make("tbody", ""), top = make("thead", "");
    for (const title of titles) {
      const cell = make("th", title);
      cell.scope = "col";
      head.append(cell);
    }
    top.append(head);
    for (const texts of rows) {
      const row = make("tr", "", classes(texts));
      texts.forEach((text, n) => {
        const cell = make("td", text, "lines");
        cell.dataset.title = titles[n];
        row.append(cell);
      });
      body.append(row);
    }
    made.append(top, body);
    return made;
  }
  // Let the browser save a file.
  function saved(blob, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }
  function say(kind, text, remedy) {
    const list = one("#told");
    if (!list) return;
    const line = make("div", "", kind);
    const words = make("p", text);
    if (remedy) words.append(make("em", remedy));
    line.append(words);
    const away = make("button", "×");
    away.setAttribute("aria-label", "Put away");
    away.onclick = () => line.remove();
    line.append(away);
    list.prepend(line);
    while (list.children.length > 4) list.lastChild.remove();
  }
  function showAxes(axes) {
    for (const [name, values] of Object.entries(axes)) {
      const section = sectionOf(name);
      if (!section) continue;
      section.classList.toggle("old", !values.known);
      for (const node of all("[data-live]", section)) {
        const key = node.dataset.live.slice(name.length + 1);
        if (key === "error") put(node, reasons(values.error));
        else put(node, values[key] ?? "");
        node.classList.toggle("unknown", values[key] === "unknown");
      }
      one("output.state", section).dataset.state = values.state;
      showBars(section, values.bars);
      for (const state of all("[data-power]", section)) state.classList.toggle("lit", state.dataset.power === values.power);
    }
    tiles(axes);
  }
  function showBars(section, bars) {
    for (const node of all("[data-bar]", section)) {
      const bar = bars[node.dataset.bar], track = one(".track", node), unit = track.dataset.unit;
      put(one("output", node), bar.text);
      put(one("em", node), bar.told);
      node.dataset.kind = bar.kind;
      node.classList.toggle("unknown", bar.at === null);
      track.style.visibility = bar.at === null ? "hidden" : ""; // a meter without a value is none, also for who hears it
      if (bar.at === null) continue;
      track.setAttribute("aria-valuenow", bar.now);
      track.setAttribute("aria-valuetext", [`${bar.text} ${unit}`, bar.told].filter(Boolean).join(", "));
      const [fill, mark] = track.children;
      fill.style.left = `${100 * Math.min(bar.at, bar.zero)}%`;
      fill.style.width = `${100 * Math.abs(bar.at - bar.zero)}%`;
      mark.style.left = `${100 * bar.at}%`;
    }
  }
  function reasons(error) {
    if (!error) return "";
    return [error.message, error.observed && `observed: ${error.observed}`, error.remedy && `remedy: ${error.remedy}`,
      error.page && `more: axisbus explain ${error.page}`].filter(Boolean).join("\n");
  }
  function tiles(axes) {
    const place = one("#tiles");
    if (!place) return;
    for (const [name, values] of Object.entries(axes)) {
      let tile = all("[data-tile]", place).find((each) => each.dataset.tile === name);
      if (!tile) {
        tile = make("a", "", "tile");
        tile.dataset.tile = name;
        tile.href = `#axis-${encodeURIComponent(name)}`;
        tile.append(make("strong", name), make("span", ""), make("output", ""));
        place.append(tile);
      }
      tile.classList.toggle("old", !values.known);
      tile.dataset.state = values.state;
      put(tile.children[1], values.state);
      const section = sectionOf(name), unit = section ? one(".values td:nth-child(3)", section).textContent : "";
      put(tile.children[2], values.position === "unknown" ? "unknown" : `${values.position} ${unit}`);
    }
  }
  function showCell(cell) {
    if (!cell || !one("#nodes")) return;
    command = cell.command;
    one("#nodes").replaceChildren(...cell.nodes.map(nodeRow));
    one("#beside").replaceChildren(...cell.beside.map((line) => make("li", line)));
    const found = cell.incidents.map(incident);
    one("#incidents").replaceChildren(...(found.length ? found : [make("li", "Nothing so far.")]));
  }
  function nodeRow(node) {
    const row = make("tr", "", node.wrong ? "wrong" : "");
    const device = make("td", "");
    const what = make("span", node.device);
    what.append(make("small", node.identity));
    device.append(what);
    const boot = node.letter ? `${node.letter}: ${node.boot}` : node.boot;
    const wrong = [reasons(node.wrong), ...node.warnings.map((text) => `warning: ${text}`)].filter(Boolean).join("\n");
    row.append(make("td", String(node.node)), device, make("td", node.nmt), make("td", boot), make("td", node.axes.join(", ")),
      make("td", wrong || "nothing", "lines"));
    all("th", one("[data-view=cell]")).forEach((title, at) => { row.children[at].dataset.title = title.textContent; });
    return row;
  }
  function incident(one_) {
    const line = make("li", "");
    line.append(make("span", one_.ago, "age"), make("strong", one_.what));
    for (const text of one_.lines) line.append(make("div", text, "lines"));
    if (one_.remedy) line.append(make("div", `remedy: ${one_.remedy}`, "remedy"));
    return line;
  }
  function showOwn(own) {
    document.body.classList.toggle("dead", own.dead !== null);
    put(one("#dead"), own.dead === null ? "" : `${own.dead[0].toUpperCase()}${own.dead.slice(1)}. Nothing on this page is of now: look at the machine before anything else.`);
    const line = own.mine ? "This page has the controls" : own.holder ? `${own.holder} has the controls` : "Nobody has the controls";
    put(one("#controls"), own.role === "operator" ? line : `This page looks on. ${line}`);
    const operator = own.role === "operator";
    const shown = { free: operator && !own.holder, others: operator && own.holder && !own.mine, mine: own.mine, operator };
    shown.lost = operator && !own.looks;
    one("#command").hidden = command.ours;
    put(one("#commanded"), `This page may only halt and stop: the machine is commanded by ${command.by}`);
    for (const node of all("[data-shown]")) node.hidden = !shown[node.dataset.shown];
    one(".axisbus")?.classList.toggle("mine", own.mine);
    one("[data-view=cell]")?.classList.toggle("old", own.cell_age > OLD_CELL);
    for (const told of own.told) {
      if (told.kind === "link") say("note", `A page that looks on, opened once by: ${told.text}`, "");
      else say(told.kind, told.text, told.remedy);
    }
  }
  function connect() {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    socket.onmessage = (event) => {
      const seen = JSON.parse(event.data);
      if (seen.axes) {
        showAxes(seen.axes);
        heard = performance.now(); // not before: what could not be shown is not of now
      }
      showCell(seen.cell);
      showOwn(seen.own);
      document.dispatchEvent(new CustomEvent("axisbus-own", { detail: seen.own }));
      freshness();
    };
    socket.onclose = () => { release(); setTimeout(connect, AGAIN); };
  }
  function freshness() {
    document.body.classList.toggle("gone", performance.now() - heard > GONE);
  }
  setInterval(freshness, 100);

  window.axisbusPage = { send, say, ask, reasons, make, put, table, saved }; // for the scripts of other views

  // -- views -------------------------------------------------------------------------------------------------------------------
  function view() {
    const name = decodeURIComponent(location.hash.slice(1)) || "cell";
    const sections = all("main > section");
    const shown = sections.find((section) => section.dataset.view === name) ?? sections[0];
    for (const section of sections) section.hidden = section !== shown;
    for (const link of all("nav a")) {
      if (decodeURIComponent(link.hash.slice(1)) === shown?.dataset.view) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
  }
  addEventListener("hashchange", () => { view(); scrollTo(0, 0); });
  const mounted = setInterval(() => {
    if (!one("main > section")) return;
    clearInterval(mounted);
    document.body.classList.add("gone");
    view();
    new MutationObserver(view).observe(one("main > section").parentElement, { childList: true }); // an axis has joined
    connect();
  }, 20);
})();
