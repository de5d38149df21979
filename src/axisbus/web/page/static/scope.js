// The scope's own script: takes batches of samples, keeps the last minute of them, and draws; every sample counts, none is thinned out.
"use strict";
(() => {
  const KEPT = 1 << 17, SHOWN_EVERY = 100, AGAIN = 1000, LEFT = 62, BELOW = 24, GAP = 10, NEAR = 4; // samples, ms, ms, pixels
  const one = (selector) => document.querySelector(selector);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  let section, canvas, socket = null, choice = 0, names = [], units = {};
  let times = new Float64Array(KEPT), traces = [], head = 0, count = 0, period = 0.001;
  let running = true, view = null, dirty = true, lostNow = 0, started = 0, opened = false, origin = 0;
  let armed = true, fired = null, cursors = { A: null, B: null }, last = "A";

  // -- stored samples: a ring; ``at(i)`` is the index of the i-th sample, oldest first ----------------------------------------
  const at = (i) => (head - count + i + KEPT) % KEPT;
  const timeOf = (i) => times[at(i)];
  const newest = () => (count ? timeOf(count - 1) : 0);
  function clear() {
    traces = names.map(() => new Float32Array(KEPT));
    head = count = lostNow = 0;
    fired = null; armed = true; view = null; dirty = true;
    cursors = { A: null, B: null };
  }
  function put(time, values) {
    if (!count) origin = time;
    times[head] = time;
    values.forEach((value, k) => { traces[k][head] = value; });
    head = (head + 1) % KEPT;
    count = Math.min(count + 1, KEPT);
  }
  // The number of the first sample at or after a time.
  function find(time) {
    let low = 0, high = count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (timeOf(middle) < time) low = middle + 1; else high = middle;
    }
    return low;
  }
  // The sample that a cursor is on: the last one at or before it; -1 where none is.
  const under = (time) => (count && time >= timeOf(0) - period ? Math.max(0, find(time + period / 4) - 1) : -1);

  // -- what comes -------------------------------------------------------------------------------------------------------------
  function take(data) {
    const form = new DataView(data), number = form.getUint32(0, true), samples = form.getUint32(4, true);
    const signals = form.getUint32(8, true), lost = form.getUint32(12, true);
    if (number !== choice || signals !== names.length || !running) return;
    if (lost) { lostNow += lost; gap(form.getFloat64(16, true)); }
    const values = 16 + 8 * samples;
    for (let i = 0; i < samples; i += 1) {
      const time = form.getFloat64(16 + 8 * i, true), row = [];
      for (let k = 0; k < signals; k += 1) row.push(form.getFloat32(values + 4 * (k * samples + i), true));
      if (count) {
        const step = time - newest();
        if (step > 0 && step < 2 * period || count === 1) period = step;
        if (step > GAP * period) gap(time);
        watch(row, time);
      }
      put(time, row);
    }
    dirty = true;
  }
  const gap = (time) => count && put((newest() + time) / 2, names.map(() => NaN));

  // -- trigger ------------------------------------------------------------------------------------------------------------------
  const span = () => Number(one("#span").value);
  const level = () => Number(one("#level").value.trim().replace(",", "."));
  function watch(row, time) {
    const mode = one("#trigger").value, k = names.indexOf(one("#trigger-on").value);
    if (!mode || k < 0) { fired = null; return; }
    const before = traces[k][at(count - 1)], now = row[k], limit = level();
    const crossed = one("#edge").value === "rising" ? before < limit && now >= limit : before > limit && now <= limit;
    if (armed && crossed) { fired = time; armed = false; }
    if (fired !== null && time >= fired + 0.75 * span()) {
      view = { from: fired - 0.25 * span(), to: fired + 0.75 * span() };
      if (mode === "single") stop();
      fired = null; armed = true;
    }
  }
  function shown() {
    if (view && (!running || one("#trigger").value)) return view;
    return { from: newest() - span(), to: newest() };
  }

  // -- run and stop ---------------------------------------------------------------------------------------------------------------
  function stop() {
    view = { ...shown() };
    running = false;
    one("#run").textContent = "Run";
    dirty = true;
  }
  function run() {
    running = true;
    one("#run").textContent = "Stop";
    clear();
  }
  function choose() {
    const boxes = all("[data-signal]", section), most = Number(section.dataset.most);
    names = boxes.filter((box) => box.checked).map((box) => box.dataset.signal);
    units = Object.fromEntries(boxes.map((box) => [box.dataset.signal, box.dataset.unit]));
    for (const box of boxes) box.disabled = !box.checked && names.length >= most;
    const on = one("#trigger-on"), chosen = on.value;
    on.replaceChildren(...names.map((name) => new Option(name, name)));
    if (names.includes(chosen)) on.value = chosen;
    rows();
    run();
    ask();
    keep();
  }
  function ask() {
    choice = (choice + 1) >>> 0;
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ choice, signals: names }));
  }
  function connect() {
    opened ||= !section.hidden;
    const wanted = opened && running && names.length > 0 && !document.hidden; // also while a view is shown that moves the axis
    if (wanted && socket === null && performance.now() - started > AGAIN) {
      started = performance.now();
      socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/scope`);
      socket.binaryType = "arraybuffer";
      socket.onopen = ask;
      socket.onmessage = (event) => take(event.data);
      socket.onclose = () => { socket = null; };
    } else if (!wanted && socket !== null) socket.close();
  }

  // -- stored by this browser for this cell ------------------------------------------------------------------------------------------
  const KEYS = ["span", "trigger", "trigger-on", "edge", "level"];
  const place = () => `axisbus.scope.${section.dataset.cell}`;
  function keep() {
    const fields = Object.fromEntries(KEYS.map((key) => [key, one(`#${key}`).value]));
    try { localStorage.setItem(place(), JSON.stringify({ names, fields })); } catch { /* it may not be kept */ }
  }
  function restore() {
    let kept = null;
    one("#level").value = "0"; // here, so that adding an axis to the page does not overwrite it
    try { kept = JSON.parse(localStorage.getItem(place())); } catch { /* none */ }
    const boxes = all("[data-signal]", section);
    const wanted = Array.isArray(kept?.names) ? kept.names : [];
    for (const box of boxes) box.checked = wanted.includes(box.dataset.signal);
    if (!boxes.some((box) => box.checked)) for (const box of boxes.slice(0, 2)) box.checked = true;
    choose();
    for (const key of KEYS) {
      const field = one(`#${key}`), value = kept?.fields?.[key];
      if (typeof value === "string" && (field.tagName === "INPUT" || [...field.options].some((each) => each.value === value)))
        field.value = value;
    }
    keep();
  }

  // -- drawing ------------------------------------------------------------------------------------------------------------------------
  const colour = (name) => getComputedStyle(section).getPropertyValue(name).trim();
  function nice(width, parts) {
    const raw = width / parts, ten = 10 ** Math.floor(Math.log10(raw));
    return [1, 2, 5, 10].map((each) => each * ten).find((each) => each >= raw) ?? raw;
  }
  const short = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(6))) : "unknown");
  function lanes() {
    const found = new Map();
    names.forEach((name, k) => found.set(units[name], [...(found.get(units[name]) ?? []), k]));
    return [...found];
  }
  function range(ks, from, to) {
    const ends = ks.map((k) => lowest(k, from, to));
    const low = Math.min(...ends.map((each) => each[0])), high = Math.max(...ends.map((each) => each[1]));
    if (low > high) return [-1, 1];
    const spare = (high - low) * 0.06 || Math.max(Math.abs(high) * 0.01, 1e-3);
    return [low - spare, high + spare];
  }
  function draw() {
    dirty = false;
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== width * ratio || canvas.height !== height * ratio) {
      canvas.width = width * ratio;
      canvas.height = height * ratio;
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = colour("--card");
    pen.fillRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    if (!count) return;
    const { from, to } = shown(), first = Math.max(0, find(from) - 1), end = Math.min(count, find(to) + 1);
    const x = (time) => LEFT + (width - LEFT) * (time - from) / (to - from);
    ticksOfTime(pen, from, to, x, width, height);
    const rooms = lanes(), tall = (height - BELOW) / Math.max(1, rooms.length);
    rooms.forEach(([unit, ks], n) => lane(pen, unit, ks, n * tall, tall, first, end, x, width));
    for (const [name, time] of Object.entries(cursors)) if (time !== null && time >= from && time <= to) {
      pen.strokeStyle = pen.fillStyle = colour("--ink");
      pen.setLineDash(name === "A" ? [] : [5, 4]);
      line(pen, x(time), 0, x(time), height - BELOW);
      pen.setLineDash([]);
      pen.fillText(name, x(time) + 3, 12);
    }
  }
  function line(pen, x1, y1, x2, y2) {
    pen.beginPath();
    pen.moveTo(x1, y1);
    pen.lineTo(x2, y2);
    pen.stroke();
  }
  function ticksOfTime(pen, from, to, x, width, height) {
    const step = nice(to - from, 8);
    pen.textAlign = "center";
    for (let k = Math.ceil((from - origin) / step); origin + k * step <= to; k += 1) {
      const time = origin + k * step;
      pen.strokeStyle = colour("--line");
      line(pen, x(time), 0, x(time), height - BELOW);
      pen.fillStyle = colour("--soft");
      if (x(time) > LEFT + 20 && x(time) < width - 25) pen.fillText(`${Number((k * step).toPrecision(6))} s`, x(time), height - 7);
    }
  }
  function lane(pen, unit, ks, top, tall, first, end, x, width) {
    const [low, high] = range(ks, first, end), y = (value) => top + 4 + (tall - 8) * (high - value) / (high - low);
    const step = nice(high - low, Math.max(3, Math.min(4, tall / 18), tall / 45)); // a lane has more than its 0
    pen.textAlign = "right";
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      pen.strokeStyle = colour("--line");
      line(pen, LEFT, y(value), width, y(value));
      pen.fillStyle = colour("--soft");
      if (y(value) > top + 6 && y(value) < top + tall - 5) pen.fillText(Number(value.toPrecision(6)), LEFT - 5, y(value) + 4);
    }
    pen.strokeStyle = colour("--soft");
    line(pen, 0, top + tall, width, top + tall);
    pen.textAlign = "left";
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, top, width - LEFT, tall);
    pen.clip();
    for (const k of ks) trace(pen, k, first, end, x, y);
    pen.restore();
    pen.fillText(unit, LEFT + 5, top + 14);
  }
  // A line from sample to sample; if several fall on one column of the screen, from the lowest to the highest of them.
  function trace(pen, k, first, end, x, y) {
    pen.strokeStyle = colour(`--trace-${k}`);
    pen.lineWidth = 1.6;
    pen.beginPath();
    let drawn = false, column = null, low = 0, high = 0, close = 0;
    const flush = () => {
      if (column !== null && high !== low) {
        pen.lineTo(column + 0.5, y(low));
        pen.lineTo(column + 0.5, y(high));
        pen.lineTo(column + 0.5, y(close));
      }
    };
    for (let i = first; i < end; i += 1) {
      const value = traces[k][at(i)];
      if (Number.isNaN(value)) { flush(); drawn = false; column = null; continue; }
      const px = x(timeOf(i)), here = Math.floor(px);
      if (here === column) {
        low = Math.min(low, value); high = Math.max(high, value); close = value;
        continue;
      }
      flush();
      if (drawn) pen.lineTo(px, y(value)); else pen.moveTo(px, y(value));
      drawn = true; column = here; low = high = close = value;
    }
    flush();
    pen.stroke();
    pen.lineWidth = 1;
  }

  // -- in words ---------------------------------------------------------------------------------------------------------------------------
  function rows() {
    one("#traces").replaceChildren(...names.map((name, k) => {
      const row = document.createElement("tr");
      for (let n = 0; n < 8; n += 1) row.append(document.createElement(n ? "td" : "th"));
      row.children[0].scope = "row";
      row.children[0].textContent = name;
      row.children[0].style.setProperty("--own-trace", `var(--trace-${k})`);
      row.children[7].textContent = units[name];
      return row;
    }));
  }
  function tell() {
    const { from, to } = shown(), first = find(from), end = find(to + period / 4);
    const [a, b] = ["A", "B"].map((name) => (cursors[name] === null ? -1 : under(cursors[name])));
    all("#traces tr").forEach((row, k) => {
      const of = (i) => (i < 0 ? NaN : traces[k][at(i)]), [low, high] = lowest(k, first, end);
      const texts = [count ? short(of(count - 1)) : "unknown", a < 0 ? "" : short(of(a)), b < 0 ? "" : short(of(b)),
        a < 0 || b < 0 ? "" : short(of(b) - of(a)), short(low), short(high)];
      texts.forEach((text, n) => { if (row.children[n + 1].textContent !== text) row.children[n + 1].textContent = text; });
    });
    state(a, b);
  }
  function lowest(k, first, end) {
    let low = Infinity, high = -Infinity;
    for (let i = first; i < end; i += 1) {
      const value = traces[k][at(i)];
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return [low, high];
  }
  function state(a, b) {
    const words = [!names.length ? "Choose a signal." : !count ? "Waiting for samples." : running ? "It runs." : "Stopped."];
    if (running && one("#trigger").value) words.push(fired !== null ? "Triggered." : "Waiting for the trigger.");
    if (one("#trigger").value && Number.isNaN(level())) words.push("The level is not a number.");
    if (a >= 0 && b >= 0) {
      const apart = timeOf(b) - timeOf(a);
      words.push(`B − A: ${short(apart)} s${apart ? `, ${short(1 / Math.abs(apart))} Hz` : ""}.`);
    }
    if (lostNow) words.push(`${lostNow} samples are missing: this page was too slow for them.`);
    const text = words.join(" "), node = one("#scope-state");
    if (node.textContent !== text) node.textContent = text;
  }

  // -- files ------------------------------------------------------------------------------------------------------------------------------
  function save(blob, ending) {
    const stamp = new Date().toISOString().slice(0, 19).replaceAll(":", "-");
    window.axisbusPage.saved(blob, `${section.dataset.cell.replace(/\.[^.]*$/, "")}-${stamp}.${ending}`);
  }
  const told = (value) => Number(value.toPrecision(8)); // what of a float32 is its value, and not its way of writing
  function csv() {
    const { from, to } = shown(), quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    const lines = [["time [s]", ...names.map((name) => `${name} [${units[name]}]`)].map(quoted).join(",")];
    for (let i = find(from); i < count && timeOf(i) <= to; i += 1) {
      const row = traces.map((each) => each[at(i)]);
      if (!row.every(Number.isNaN)) lines.push([timeOf(i).toFixed(6), ...row.map((each) => (Number.isNaN(each) ? "" : told(each)))].join(","));
    }
    return `${lines.join("\r\n")}\r\n`;
  }

  // The displayed samples, in the server's format (web/scope/saving.py); rows without a known value are left out.
  function samples() {
    const { from, to } = shown(), rows = [], text = new TextEncoder().encode(JSON.stringify(names));
    for (let i = find(from); i < count && timeOf(i) <= to; i += 1)
      if (!traces.every((each) => Number.isNaN(each[at(i)]))) rows.push(i);
    const data = new DataView(new ArrayBuffer(8 + text.length + rows.length * (8 + 4 * names.length)));
    data.setUint32(0, rows.length, true);
    data.setUint32(4, text.length, true);
    new Uint8Array(data.buffer).set(text, 8);
    const begin = 8 + text.length, values = begin + 8 * rows.length;
    rows.forEach((i, n) => {
      data.setFloat64(begin + 8 * n, timeOf(i), true);
      traces.forEach((each, k) => data.setFloat32(values + 4 * (k * rows.length + n), each[at(i)], true));
    });
    return data;
  }
  // The picture below what its lines are, which a file shows nowhere else.
  function png() {
    draw();
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, made = document.createElement("canvas"), pen = made.getContext("2d");
    const font = "12px system-ui, sans-serif", room = 8, tall = 18, places = [];
    pen.font = font;
    let x = room, y = tall;
    for (const [k, name] of names.entries()) {
      const text = `${name} [${units[name]}]`, wide = pen.measureText(text).width + 24;
      if (x > room && x + wide > width) [x, y] = [room, y + tall];
      places.push({ text, x, y, ink: colour(`--trace-${k}`) });
      x += wide;
    }
    const above = places.length ? y + room : 0;
    made.width = canvas.width;
    made.height = canvas.height + Math.ceil(above * ratio);
    pen.fillStyle = colour("--card");
    pen.fillRect(0, 0, made.width, made.height);
    pen.drawImage(canvas, 0, Math.ceil(above * ratio));
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = font;
    for (const { text, x: left, y: base, ink } of places) {
      pen.fillStyle = ink;
      pen.fillRect(left, base - 5, 12, 3);
      pen.fillText(text, left + 16, base);
    }
    return made;
  }
  async function mcap() {
    const { say } = window.axisbusPage, data = samples();
    if (!data.getUint32(0, true)) return say("refused", "There is nothing on the scope to save.", "");
    one("#save-mcap").disabled = true;
    try {
      const answer = await fetch("/scope/mcap", { method: "POST", body: data });
      if (answer.headers.get("content-type") === "application/json") {
        const { error } = await answer.json();
        say("failed", [error.message, error.observed].filter(Boolean).join(": "), error.remedy);
      } else if (answer.ok) save(await answer.blob(), "mcap");
      else say("failed", `The file was not made: ${answer.status}`, "show a shorter time, and save it");
    } catch {
      say("failed", "There is no connection: no file was made.", "");
    }
    one("#save-mcap").disabled = false;
  }

  // -- hands ------------------------------------------------------------------------------------------------------------------------------
  const timeAt = (px) => { const { from, to } = shown(); return from + (to - from) * (px - LEFT) / (canvas.clientWidth - LEFT); };
  function snap(name, time) {
    const i = count ? Math.min(count - 1, Math.max(0, find(time - period / 2))) : -1;
    if (i < 0) return;
    if (running) stop();
    cursors[name] = timeOf(i);
    last = name;
    dirty = true;
  }
  function zoom(factor, around) {
    if (running) stop();
    const { from, to } = view, wide = Math.min(120, Math.max(5 * period, (to - from) * factor)), part = (around - from) / (to - from);
    view = { from: around - part * wide, to: around + (1 - part) * wide };
    dirty = true;
  }
  function hands() {
    let drag = null;
    canvas.addEventListener("pointerdown", (event) => {
      drag = { x: event.offsetX, moved: false, view: { ...shown() } };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!drag || running) return;
      drag.moved ||= Math.abs(event.offsetX - drag.x) > NEAR;
      if (!drag.moved) return;
      const by = (drag.x - event.offsetX) * (drag.view.to - drag.view.from) / (canvas.clientWidth - LEFT);
      view = { from: drag.view.from + by, to: drag.view.to + by };
      dirty = true;
    });
    canvas.addEventListener("pointerup", (event) => {
      if (drag && !drag.moved) snap(event.shiftKey ? "B" : "A", timeAt(event.offsetX));
      drag = null;
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoom(event.deltaY < 0 ? 0.8 : 1.25, timeAt(event.offsetX));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const { from, to } = shown(), middle = cursors[last] ?? (from + to) / 2, way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 0.8 : 1.25, middle);
      else if (way) snap(event.shiftKey ? "B" : last, (cursors[event.shiftKey ? "B" : last] ?? middle) + way * period);
      else return;
      event.preventDefault();
    });
    one("#run").onclick = () => (running ? stop() : run());
    one("#save-csv").onclick = () => save(new Blob([csv()], { type: "text/csv" }), "csv");
    one("#save-png").onclick = () => png().toBlob((blob) => save(blob, "png"));
    if (one("#save-mcap")) one("#save-mcap").onclick = mcap;
    // The space bar stops the machine, whatever has the focus: a box is ticked by Enter.
    section.addEventListener("keydown", (event) => { if (event.key === "Enter" && event.target.dataset.signal) event.target.click(); });
    section.addEventListener("change", (event) => {
      if (event.target.dataset.signal) choose();
      else if (event.target.id) { fired = null; armed = true; if (event.target.id === "span" && !running) view.from = view.to - span(); keep(); dirty = true; }
    });
  }
  window.axisbusScope = { csv, png, count: () => count }; // for access to the samples in the browser's console
  const mounted = setInterval(() => {
    section = one("main > section[data-view=scope]");
    canvas = one("#picture");
    if (!section || !canvas) return;
    clearInterval(mounted);
    hands();
    restore();
    setInterval(connect, SHOWN_EVERY);
    setInterval(() => section.hidden || tell(), SHOWN_EVERY);
    const paint = () => { if (dirty && !section.hidden) draw(); requestAnimationFrame(paint); };
    paint();
    addEventListener("resize", () => { dirty = true; });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { dirty = true; });
  }, 20);
})();
