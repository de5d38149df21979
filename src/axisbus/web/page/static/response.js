// Draws both sides of a trial, relative to the start position: actual, target and demand, and the actual of a pinned trial.
"use strict";
(() => {
  const LEFT = 56, TOP = 22, BELOW = 22, RIGHT = 8, NARROW = 600, SPARE = 0.08; // pixels, but the last: a part
  const SIDES = [["there", "There"], ["back", "Back"]];
  const DASHES = { actual: [], target: [7, 4], demand: [2, 3] };
  const colour = (canvas, name) => getComputedStyle(canvas).getPropertyValue(`--${name}`).trim();
  const short = (value) => String(Number(value.toPrecision(4)));
  function nice(width, parts) {
    const raw = width / parts, ten = 10 ** Math.floor(Math.log10(raw));
    return [1, 2, 5, 10].map((each) => each * ten).find((each) => each >= raw) ?? raw;
  }
  // The start position: curves are drawn relative to it, so that two trials can be compared.
  const stood = (trial) => trial?.there?.target[0] ?? 0;
  function span(trials, of) {
    let low = Infinity, high = -Infinity;
    for (const trial of trials) for (const [side] of SIDES) for (const name of of) {
      const from = name === "times" ? 0 : stood(trial);
      for (const value of trial[side]?.[name] ?? []) {
        if (value === null) continue;
        low = Math.min(low, value - from);
        high = Math.max(high, value - from);
      }
    }
    return low <= high ? [low, high] : [0, 1];
  }
  function draw(canvas, last, pinned) {
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = colour(canvas, "card");
    pen.fillRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    const trials = [pinned, last].filter(Boolean);
    if (!trials.length) return;
    const times = span(trials, ["times"]), values = span(trials, ["actual", "target", "demand"]);
    const spare = (values[1] - values[0]) * SPARE || 1;
    const range = { from: Math.min(0, times[0]), to: times[1], low: values[0] - spare, high: values[1] + spare };
    const { kind, unit: of } = last ?? pinned, unit = kind === "position" ? `${of} from the start position` : of;
    const narrow = width < NARROW, wide = narrow ? width : width / 2, tall = narrow ? height / 2 : height;
    SIDES.forEach(([side, title], n) => {
      const room = { x: narrow ? 0 : n * wide, y: narrow ? n * tall : 0, wide, tall };
      panel(canvas, pen, room, range, side, `${title}, in ${unit}`, last, pinned);
    });
  }
  function panel(canvas, pen, room, range, side, title, last, pinned) {
    const across = room.wide - LEFT - RIGHT, down = room.tall - TOP - BELOW;
    const x = (time) => room.x + LEFT + across * (time - range.from) / (range.to - range.from || 1);
    const y = (value) => room.y + TOP + down * (range.high - value) / (range.high - range.low);
    grid(canvas, pen, room, range, x, y);
    pen.fillStyle = colour(canvas, "ink");
    pen.textAlign = "left";
    pen.fillText(title, room.x + LEFT, room.y + 14);
    pen.save();
    pen.beginPath();
    pen.rect(room.x + LEFT, room.y + TOP, across, down);
    pen.clip();
    if (pinned?.[side]) line(pen, pinned, side, "actual", x, y, colour(canvas, "pinned"), 1.6);
    if (last?.[side]) for (const name of ["target", "demand", "actual"])
      line(pen, last, side, name, x, y, colour(canvas, name), name === "actual" ? 2 : 1.4);
    pen.restore();
  }
  function grid(canvas, pen, room, range, x, y) {
    pen.strokeStyle = colour(canvas, "line");
    pen.fillStyle = colour(canvas, "soft");
    pen.lineWidth = 1;
    pen.setLineDash([]);
    const bottom = room.y + room.tall - BELOW, right = room.x + room.wide - RIGHT;
    const step = nice(range.to - range.from || 1, Math.max(3, room.wide / 110));
    const rise = nice(range.high - range.low, Math.max(3, room.tall / 55));
    pen.textAlign = "center";
    for (let time = Math.ceil(range.from / step) * step; time <= range.to; time += step) {
      stroke(pen, x(time), room.y + TOP, x(time), bottom);
      if (x(time) < right - 14) pen.fillText(`${short(time)} s`, x(time), bottom + 15);
    }
    pen.textAlign = "right";
    for (let value = Math.ceil(range.low / rise) * rise; value <= range.high; value += rise) {
      stroke(pen, room.x + LEFT, y(value), right, y(value));
      pen.fillText(short(Math.abs(value) < rise / 1e6 ? 0 : value), room.x + LEFT - 5, y(value) + 4);
    }
  }
  function stroke(pen, x1, y1, x2, y2) {
    pen.beginPath();
    pen.moveTo(x1, y1);
    pen.lineTo(x2, y2);
    pen.stroke();
  }
  // A line from sample to sample; unknown values are gaps.
  function line(pen, trial, side, name, x, y, ink, thick) {
    const { times, [name]: values } = trial[side], from = stood(trial);
    pen.strokeStyle = ink;
    pen.lineWidth = thick;
    pen.setLineDash(DASHES[name]);
    pen.beginPath();
    let drawn = false;
    values.forEach((value, n) => {
      if (value === null) { drawn = false; return; }
      if (drawn) pen.lineTo(x(times[n]), y(value - from)); else pen.moveTo(x(times[n]), y(value - from));
      drawn = true;
    });
    pen.stroke();
    pen.setLineDash([]);
  }
  window.axisbusResponse = { draw };
})();
