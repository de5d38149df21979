// The script of the page: shows values and whether they are old, sends commands, and sends the keep-alive messages of a jog.
"use strict";
(() => {
  const GONE = 600, SLOW = 1000, DROP = 5000, BEAT = 50, IDLE = 250, UNHEARD = 1500, AGAIN = 1000, OLD_CELL = 3; // ms; the last: s
  const STOPS = ["quick_stop", "halt", "halt_all"]; // which are sent whatever the connection is like
  let socket = null, begun = 0, heard = -Infinity, press = 0, held = null, asked = null;
  // Server time of the displayed values; page time up to which the server has received this socket's messages; ms of the last beat.
  let seen = null, answered = null, beaten = 0, unknown = false;
  let command = { ours: true, by: "" };
  const one = (selector, within = document) => within.querySelector(selector);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const open = () => socket !== null && socket.readyState === WebSocket.OPEN;
  const isText = (node) => (node instanceof HTMLInputElement && node.type === "text") || node instanceof HTMLTextAreaElement;

  // -- out ---------------------------------------------------------------------------------------------------------------
  function send(message) {
    if (!open()) return false;
    const sent = performance.now() / 1000;
    socket.send(JSON.stringify(seen === null ? { ...message, sent } : { ...message, sent, seen }));
    return true;
  }
  // The server evaluates only the verb of a stop: the next beat shows that the server has received it.
  function quickStop() {
    release();
    withdraw();
    const by = send({ do: "quick_stop_all" }) && !lost() ? socket : null;
    window.axisbusStop.begin(by);
    idle();
  }
  function idle() {
    beaten = performance.now();
    send({ do: "beat" });
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
    if (node.dataset.node) message.node = Number(node.dataset.node);
    if (node.closest("fieldset")) message.values = valuesOf(node);
    const stops = STOPS.includes(verb);
    if (stops) withdraw();
    const by = socket, at = performance.now();
    if ((lost() && !stops) || !send(message))
      return say("failed", "There is no connection: nothing was sent.", stops ? "Quick stop also uses a second connection; if it fails, use the emergency stop" : "");
    idle();
    setTimeout(() => {
      if (by === socket && answered >= at) return;
      const what = `${node.textContent}: it is not known whether this has arrived.`;
      say("failed", what, stops ? "press Quick stop, which also uses a second connection; if it fails, use the emergency stop" : "check the state of the axes");
    }, UNHEARD);
  }

  // -- press and hold -----------------------------------------------------------------------------------------------------
  function hold(node, touched = false) {
    release();
    if (lost()) return say("failed", "There is no connection: jogging is not possible.", "");
    press += 1;
    held = { axis: axisOf(node), values: { ...valuesOf(node), direction: node.dataset.jog }, press, node, touched };
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
  setInterval(() => held || idle(), IDLE);
  // A jog that the server has ended is no longer held, even if the button is still pressed.
  function letGo(own) {
    if (!held) return;
    const refused = own.told.some(({ kind }) => kind === "refused" || kind === "failed"), { axis } = held;
    if (!refused && (own.press < held.press || own.held)) return;
    release();
    if (!own.told.length) say("note", `The jog of ${axis} has ended.`, "press again to continue");
  }

  const jogOf = (event) => event.target instanceof Element && event.target.closest("[data-jog]");
  addEventListener("pointerdown", (event) => {
    const node = jogOf(event);
    if (!node || event.button !== 0) return;
    event.preventDefault();
    node.focus();
    node.setPointerCapture(event.pointerId);
    hold(node, event.pointerType === "touch");
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "pagehide", "hashchange"]) addEventListener(name, release, true);
  // With another button down, that the first one is let go is no pointerup.
  addEventListener("pointermove", (event) => { if (held && event.pointerType === "mouse" && !(event.buttons & 1)) release(); }, true);
  // A finger that holds a button for long asks for no menu.
  addEventListener("contextmenu", (event) => { if (held?.touched) event.preventDefault(); else release(); }, true);
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
    } else if (event.key === "Enter" && event.repeat && !(event.target instanceof HTMLTextAreaElement)) {
      event.preventDefault(); // one press of the key is one press of a button, however long it is
      event.stopImmediatePropagation();
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
    if (!node.dataset.do) {
      const yes = node.id === "yes" && asked;
      withdraw();
      if (yes) yes();
    } else if (node.dataset.question) ask(worded(node), () => act(node, true));
    else act(node, false);
  });
  // A question, with the typed values in place of the names in braces.
  function worded(node) {
    const typed = valuesOf(node);
    return node.dataset.question.replace(/\{(\w+)\}/g, (_, name) => typed[name] || "?");
  }
  // A stop withdraws a question asked before it.
  function withdraw() {
    asked = null;
    one("#question")?.close();
  }
  function ask(text, yes) {
    if (one("#question").open) return false; // an open question must not change while the user answers it
    asked = yes;
    one("#asked").textContent = text;
    one("#question").showModal();
    one("#no").focus();
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
      track.style.visibility = bar.at === null ? "hidden" : ""; // a meter without a value is hidden, also from screen readers
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
    for (const node of all("#boots button")) node.hidden = !cell.nodes.some((each) => String(each.node) === node.dataset.node && each.needs_boot);
    one("#beside").replaceChildren(...cell.beside.map((line) => make("li", line)));
    const found = cell.incidents.map(incident);
    one("#incidents").replaceChildren(...(found.length ? found : [make("li", "None.")]));
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
      make("td", wrong || "none", "lines"));
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
  function showBoots(boots) {
    for (const node of all("#boots button")) node.disabled = boots.some((each) => String(each.node) === node.dataset.node);
    put(one("#boot-state"), boots.map(({ node, step }) => `Node ${node} is being booted: ${step}.`).join(" "));
  }
  function showOwn(own) {
    document.body.classList.toggle("dead", own.dead !== null);
    put(one("#dead"), own.dead === null ? "" : `${own.dead[0].toUpperCase()}${own.dead.slice(1)}. All values on this page are outdated: look at the machine before anything else.`);
    const line = own.mine ? "This page has the controls" : own.holder ? `${own.holder} has the controls` : "No page has the controls";
    put(one("#controls"), own.role === "operator" ? line : `This is an observer page. ${line}`);
    const operator = own.role === "operator";
    const shown = { free: operator && !own.holder, others: operator && own.holder && !own.mine, mine: own.mine, operator };
    shown.lost = operator && !own.looks;
    one("#command").hidden = command.ours;
    put(one("#commanded"), `This page may only halt and stop: control of the machine belongs to ${command.by}`);
    for (const node of all("[data-shown]")) node.hidden = !shown[node.dataset.shown];
    one(".axisbus")?.classList.toggle("mine", own.mine);
    one("[data-view=cell]")?.classList.toggle("old", own.cell_age > OLD_CELL);
    for (const told of own.told) {
      if (told.kind === "link") say("note", `Link that opens an observer page, once: ${told.text}`, "");
      else say(told.kind, told.text, told.remedy);
    }
  }
  function take(news) {
    const { own } = news;
    if (news.axes) {
      showAxes(news.axes);
      heard = performance.now(); // not before: values that could not be shown are not current
    }
    seen = own.now;
    if (own.heard !== null) answered = 1000 * own.heard;
    if (answered !== null) window.axisbusStop.heard(socket, answered);
    letGo(own);
    showCell(news.cell);
    showOwn(own);
    showBoots(own.boots);
    document.dispatchEvent(new CustomEvent("axisbus-own", { detail: own }));
    freshness();
    if (performance.now() - beaten > IDLE && !held) idle(); // also where the browser holds the clocks of a hidden page up
  }
  function connect() {
    const mine = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    [socket, begun, seen, answered] = [mine, performance.now(), null, null];
    let was = false;
    mine.onopen = () => { was = true; unknown = false; idle(); };
    mine.onmessage = (event) => { if (mine === socket) take(JSON.parse(event.data)); };
    mine.onclose = () => { if (mine === socket) ended(was); };
  }
  function ended(was) {
    socket = null;
    release();
    setTimeout(connect, unknown ? DROP : AGAIN);
    if (!was) fetch("/", { method: "HEAD" }).then((answer) => { unknown = answer.status === 403; }, () => {});
  }
  // A socket that receives nothing may have lost its server.
  function drop() {
    const dead = socket, was = open();
    socket = null;
    dead.close();
    ended(was);
  }
  const silent = () => performance.now() - heard > GONE;
  const slow = () => answered === null || performance.now() - answered > SLOW;
  const lost = () => silent() || slow();
  const GONE_IS = "The connection is lost: all values on this page are outdated.";
  const SLOW_IS = "The connection is slow: all values on this page are outdated, and commands may arrive late.";
  const UNKNOWN_IS = "The server has been restarted, and does not know this browser: open its new link. All values on this page are outdated.";
  function freshness() {
    const is = lost();
    document.body.classList.toggle("gone", is);
    if (is) put(one("#gone"), unknown ? UNKNOWN_IS : silent() ? GONE_IS : SLOW_IS);
    const since = Math.max(begun, heard);
    if (socket && performance.now() - since > (open() ? DROP : 3 * DROP)) drop();
  }
  setInterval(freshness, 100);
  document.addEventListener("visibilitychange", () => document.hidden || idle());

  window.axisbusPage = { send, say, ask, reasons, make, put, table, saved }; // for the scripts of other views

  // -- views -------------------------------------------------------------------------------------------------------------------
  function view() {
    let name = "cell";
    try { name = decodeURIComponent(location.hash.slice(1)); } catch { /* it names no view */ }
    const sections = all("main > section");
    const shown = sections.find((section) => section.dataset.view === name) ?? sections[0];
    for (const section of sections) section.hidden = section !== shown;
    for (const link of all("nav a")) {
      if (decodeURIComponent(link.hash.slice(1)) === shown?.dataset.view) {
        link.setAttribute("aria-current", "page");
        link.parentElement.scrollTop = link.offsetTop - link.parentElement.offsetTop;
      } else link.removeAttribute("aria-current");
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
