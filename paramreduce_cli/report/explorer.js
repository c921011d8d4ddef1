// The explorer: one state (a curve and a row of it), and everything on the page that follows it.
(async () => {
  "use strict";
  const source = document.getElementById("explorer-data");
  if (!source || !window.DecompressionStream) return;
  const data = JSON.parse(source.textContent);
  const TYPES = { float32: Float32Array, float64: Float64Array, uint32: Uint32Array, uint16: Uint16Array };
  const root = document.getElementById("explorer");
  const part = (name) => root.querySelector(`[data-part="${name}"]`);
  const element = (tag, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // Curves have a colour for each ground.
  const shade = (curve) => (dark.matches ? curve.dark : curve.colour);
  // A canvas as PNG, on the ground that it lies on.
  // One or several, one below the other, and what their colours mean.
  function picture(canvases, names = []) {
    const width = Math.max(...canvases.map((c) => c.width)), scale = window.devicePixelRatio || 1;
    const drawn = canvases.reduce((sum, c) => sum + c.height, 0), line = 18 * scale;
    const copy = element("canvas", { width, height: drawn + line * names.length + (names.length ? line / 2 : 0) });
    const context = copy.getContext("2d");
    context.fillStyle = colour("--card");
    context.fillRect(0, 0, copy.width, copy.height);
    let at = 0;
    for (const canvas of canvases) {
      context.drawImage(canvas, 0, at);
      at += canvas.height;
    }
    context.font = `${12 * scale}px system-ui`;
    for (const [text, ink] of names) {
      at += line;
      context.fillStyle = ink;
      context.fillRect(12 * scale, at - 5 * scale, 18 * scale, 3 * scale);
      context.fillStyle = colour("--ink");
      context.fillText(text, 38 * scale, at);
    }
    return copy.toDataURL();
  }
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // ---- data

  async function unpacked(value) {
    if (Array.isArray(value)) return Promise.all(value.map(unpacked));
    if (value === null || typeof value !== "object") return value;
    if ("data" in value && "type" in value) {
      const bytes = Uint8Array.from(atob(value.data), (c) => c.charCodeAt(0));
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
      return new TYPES[value.type](await new Response(stream).arrayBuffer());
    }
    const entries = Object.entries(value).map(async ([key, one]) => [key, await unpacked(one)]);
    return Object.fromEntries(await Promise.all(entries));
  }
  const { curves, models, motion, figure, joints, columns } = Object.assign(data, {
    curves: await unpacked(data.curves),
    models: await unpacked(data.models),
    motion: await unpacked(data.motion),
    figure: await unpacked(data.figure),
  });
  root.hidden = false;
  document.querySelectorAll("nav .live").forEach((link) => { link.hidden = false; });
  const nSamples = motion.time.length;
  const nDof = motion.tau.length / nSamples;
  const DASHED = { estimation: "— estimation", validation: "- - validation", test: "··· test, median" };
  const SETS = ["estimation", "validation", "test"].filter((s) => curves.some((c) => c.torque[s].some(Number.isFinite)));

  function modelOf(curve, row) {
    const k = curve.model[row];
    if (k < 0) return { columns: [], values: [] };
    const [from, to] = [models.starts[k], models.starts[k + 1]];
    return { columns: models.columns.subarray(from, to), values: models.values.subarray(from, to) };
  }

  function torque(model, joint) {
    const result = new Float64Array(nSamples);
    for (let t = 0; t < nSamples; t++) {
      const row = (t * nDof + joint) * columns.length;
      let sum = 0;
      for (let k = 0; k < model.columns.length; k++) sum += motion.W[row + model.columns[k]] * model.values[k];
      result[t] = sum;
    }
    return result;
  }

  function percent(value) {
    if (!Number.isFinite(value)) return "∞";
    if (value >= 10) return "> 1000 %";
    return value < 1e-10 ? "0 %" : `${shortest(100 * value)} %`;
  }
  const pair = (errors, row) => SETS.map((s) => percent(errors[s][row])).map((text, k, all) => (k < all.length - 1 && !text.startsWith(">") ? text.replace(/ %$/, "") : text)).join(" / ");
  const shortest = (value) => `${Number(value.toPrecision(3))}`;

  // ---- state

  // Three heuristics and one set at first, so that the curves can be told apart: the selected one, the best, the usual one.
  const FIRST = [data.selected.heuristic, "best-subset", "forward-selection", ...curves.flatMap((c) => c.names)];
  const firstCurves = [...new Set(FIRST.map((name) => curves.findIndex((c) => c.names.includes(name))))].filter((k) => k >= 0).slice(0, 3);
  const state = {
    curve: 0, row: 0, other: null, sets: new Set(SETS.slice(0, 1)),
    hidden: new Set(curves.map((_, k) => k).filter((k) => !firstCurves.includes(k))),
  };
  const named = (name) => Math.max(0, curves.findIndex((c) => c.names.includes(name)));
  const rowOf = (curve, n) => {
    const all = curves[curve].n;
    let best = 0;
    all.forEach((m, k) => { if (Math.abs(m - n) < Math.abs(all[best] - n)) best = k; });
    return best;
  };
  const MODEL = /^#(.+):(\d+)$/; // of an address that shows a model, such as #best-subset:18
  const nameOf = (curve, row) => `${curves[curve].names[0]}:${curves[curve].n[row]}`;
  function fromAddress() {
    const [, heuristic, n] = decodeURIComponent(location.hash).match(MODEL) ?? [];
    state.curve = named(heuristic ?? data.selected.heuristic);
    state.row = rowOf(state.curve, Number(n ?? data.selected.n));
  }
  const followers = [];
  function go(curve, row) {
    state.curve = curve;
    state.row = Math.min(Math.max(row, 0), curves[curve].n.length - 1);
    history.replaceState(null, "", `#${nameOf(state.curve, state.row)}`);
    follow();
  }
  function follow() {
    const curve = curves[state.curve];
    const model = modelOf(curve, state.row);
    for (const follower of followers) follower(curve, state.row, model);
  }

  // ---- controls and figures in words

  const chosen = part("heuristic");
  curves.forEach((c, k) => chosen.append(element("option", { value: k, textContent: c.names.join(", ") })));
  chosen.addEventListener("change", () => go(+chosen.value, rowOf(+chosen.value, curves[state.curve].n[state.row])));
  const slider = part("n");
  slider.addEventListener("input", () => go(state.curve, +slider.value));
  const tolerance = part("tolerance");
  tolerance.addEventListener("change", () => {
    const text = tolerance.value.trim().replace(/ ?%$/, "").replace(",", ".");
    if (text === "") return;
    if (!(Number(text) > 0)) return refuse(`"${tolerance.value}" is not a positive number; write one such as 1.5`);
    const own = curves[state.curve], limit = Math.max(Number(text) / 100, 1e-10);
    const worst = own.n.map((_, k) => Math.max(...SETS.filter((s) => s !== "test").map((s) => own.torque[s][k]).filter((e) => !Number.isNaN(e))));
    const kept = worst.findIndex((error) => error <= limit);
    if (kept >= 0) go(state.curve, kept);
    else refuse(`no model of ${own.names[0]} is within ${text} %; the least error is ${percent(Math.min(...worst))}`);
  });
  function refuse(text) {
    Object.assign(part("no-such"), { hidden: false, textContent: text });
  }
  const pin = part("pin");
  pin.addEventListener("click", () => {
    state.other = state.other ? null : { curve: state.curve, row: state.row };
    pin.textContent = state.other ? `Stop comparing with ${nameOf(state.other.curve, state.other.row)}` : "Compare with another model";
    follow();
  });
  // Two models side by side: numbers, and parameters of one alone.
  function versus(curve, row) {
    const c = curves[curve], count = (key) => `${c.operations[key]?.[row] ?? "–"}`;
    const counted = data.counted ? [["acceleration error", pair(c.acceleration, row)], ["operations, inverse dynamics", count("inverse")], ["operations, direct dynamics", count("direct")]] : [];
    return [["parameters", `${c.n[row]}`], [`torque error, ${SETS.join(" / ")}`, pair(c.torque, row)], ...counted];
  }
  followers.push((curve, row, model) => {
    const place = part("versus"), other = state.other;
    place.hidden = part("pinned-key").hidden = !other;
    if (!other) return;
    const [mine, theirs] = [model, modelOf(curves[other.curve], other.row)].map((one) => new Set(one.columns));
    const alone = (a, b) => [...a].filter((k) => !b.has(k)).map((k) => columns[k].name).join(" ") || "none";
    const left = versus(state.curve, row), right = versus(other.curve, other.row);
    const lines = [["", nameOf(state.curve, row), nameOf(other.curve, other.row)], ...left.map(([what, value], k) => [what, value, right[k][1]]),
      ["parameters of one alone", alone(mine, theirs), alone(theirs, mine)]];
    place.querySelector("table").replaceChildren(...lines.map((line, k) => element("tr", {}, ...line.map((text) => element(k ? "td" : "th", { textContent: text, className: text.length > 60 ? "long" : "" })))));
  });
  followers.push((curve, row, model) => {
    part("no-such").hidden = true;
    chosen.value = state.curve;
    slider.max = curve.n.length - 1;
    slider.value = row;
    slider.setAttribute("aria-valuetext", `${curve.n[row]} parameters`);
    part("count").textContent = curve.n[row];
    const others = finders(state.curve, row).filter((name) => !curve.names.includes(name));
    part("others").textContent = others.length ? `Found by ${others.join(", ")} too.` : "No other heuristic found it.";
    part("torque").textContent = pair(curve.torque, row);
    for (const key of ["inverse", "direct"]) {
      const cell = part(key);
      if (cell) cell.textContent = curve.operations[key]?.[row] ?? "–";
    }
    const acceleration = part("acceleration");
    if (acceleration) acceleration.textContent = pair(curve.acceleration, row);
    part("command").textContent = `${root.dataset.command} --model ${curve.names[0]}:${curve.n[row]}`;
    const values = new Map(Array.from(model.columns, (k, i) => [k, model.values[i]]));
    const told = ([k, value]) => `${columns[k].name} = ${Number(value.toPrecision(6))} ${columns[k].unit.replace("^2", "²")}`.trimEnd();
    part("values").textContent = [...values].map(told).join("; ");
    const others_ = new Set(state.other ? modelOf(curves[state.other.curve], state.other.row).columns : []);
    columns.forEach((column, k) => {
      const kept = values.has(k);
      column.chip.className = `chip${kept ? " kept" : ""}${others_.has(k) ? " other" : ""}`;
      const value = kept ? `${column.name} = ${Number(values.get(k).toPrecision(6))} ${column.unit}` : `${column.name}: dropped`;
      column.chip.title = value;
    });
    root.querySelectorAll("[data-joint-error]").forEach((cell) => {
      const [set, j] = cell.dataset.jointError.split(":");
      const joint = joints[+j];
      const error = curve.joints[set][row * nDof + joint.index];
      const share = joint.rms[set] > 1e-100 ? percent(error / joint.rms[set]) : "no torque";
      // Where there is little room the line breaks between both, not within one.
      const parts = joint.unit ? [`${share},`, `${Number(error.toPrecision(2))} ${joint.unit}`] : [share];
      cell.replaceChildren(...parts.flatMap((text, k) => [...(k ? [" "] : []), element("span", { textContent: text })]));
    });
  });

  // Parameters by what they belong to.
  const owners = new Map();
  for (const column of columns) {
    if (!owners.has(column.owner)) owners.set(column.owner, []);
    column.chip = element("span", { textContent: column.symbol });
    owners.get(column.owner).push(column.chip);
  }
  for (const [owner, chips] of owners) {
    part("parameters").append(element("div", { className: "owner" }, element("b", { textContent: owner }), ...chips));
  }

  // Errors joint by joint.
  const errors = part("joints");
  errors.append(element("thead", {}, element("tr", {}, element("th", { textContent: "joint" }), ...SETS.map((s) => element("th", { textContent: s })))));
  const body = element("tbody");
  joints.forEach((joint, j) => {
    const cells = SETS.map((s) => { const cell = element("td"); cell.dataset.jointError = `${s}:${j}`; return cell; });
    body.append(element("tr", {}, element("td", { textContent: joint.name }), ...cells));
  });
  errors.append(body);

  // ---- charts

  const drawn = [];
  const axis = (label, more = {}) => ({
    label, labelSize: 18, labelFont: "12px system-ui", font: "11px system-ui",
    stroke: () => colour("--soft"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { stroke: () => colour("--line") }, ...more,
  });
  const isPower = (v) => Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-6;
  const powersOnly = (u, ticks) => ticks.map((v) => (isPower(v) ? v : null));
  const FLOOR = 1e-5; // errors below are drawn there: what is exact, but for rounding
  const spelled = (v) => `${Number((100 * v).toPrecision(3))} %`;
  const errorAxis = (label) => {
    const lines = { stroke: () => colour("--line"), width: 1, filter: powersOnly };
    return axis(label, { filter: powersOnly, grid: lines, ticks: lines, size: 66, values: (u, ticks) => ticks.map((v) => (v === null ? null : spelled(v))) });
  };
  const errorScale = { distr: 3, range: (u, low, high) => [Math.max(low || FLOOR, FLOOR) / 1.5, Math.min(high || 1, 10) * 1.5] };
  function plot(place, height, options, values) {
    const made = new uPlot({
      width: Math.max(place.clientWidth, 200), height, legend: { show: false }, cursor: { drag: { x: false, y: false } }, ...options,
    }, values, place);
    new ResizeObserver(() => {
      const width = place.clientWidth;
      if (width && width !== made.width) made.setSize({ width, height });
    }).observe(place);
    drawn.push(made);
    return made;
  }
  const visible = (value) => (Number.isFinite(value) ? Math.max(value, FLOOR) : null);

  // Points of a chart that can be pointed at: what is nearest is named, and a click goes there.
  function pointing(u, points, spot) {
    const nearest = (event) => {
      const box = u.over.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left, event.clientY - box.top];
      let best = null, least = 30 ** 2;
      for (const p of points()) {
        const [dx, dy] = [u.valToPos(p.x, "x") - x, u.valToPos(p.y, "y") - y];
        if (dx * dx + dy * dy < least) { least = dx * dx + dy * dy; best = p; }
      }
      return best;
    };
    u.over.addEventListener("mousemove", (event) => {
      const p = nearest(event);
      spot.textContent = p ? p.text : " ";
      u.over.style.cursor = p && "curve" in p ? "pointer" : "default";
    });
    u.over.addEventListener("click", (event) => {
      const p = nearest(event);
      if (p && "curve" in p) go(p.curve, p.row);
    });
  }
  const shownCurves = () => curves.map((c, k) => k).filter((k) => !state.hidden.has(k));
  // All heuristics that found the very model of a curve's row.
  const finders = (k, row) => curves.filter((c) => c.model.includes(curves[k].model[row])).flatMap((c) => c.names);
  const spoken = (k, row) => {
    const c = curves[k];
    const cost = c.operations.inverse?.[row] != null ? `, ${data.functions[0]} in ${c.operations.inverse[row]} operations` : "";
    return `${finders(k, row).join(", ")}: ${c.n[row]} ${c.n[row] === 1 ? "parameter" : "parameters"}, ${SETS.map((s) => percent(c.torque[s][row])).join(" / ")}${cost}`;
  };

  // Error against the number of parameters. What several heuristics found is drawn once, for the first one that is shown.
  const largest = Math.max(...curves.flatMap((c) => c.n));
  const ns = Array.from({ length: largest }, (_, k) => k + 1);
  // The best subset is the headline: drawn last, and thick.
  const isBest = (k) => curves[k].names.includes("best-subset");
  const order = curves.map((_, k) => k).reverse().sort((a, b) => isBest(a) - isBest(b));
  const lines = order.flatMap((k) => SETS.map((set) => ({ curve: k, set })));
  function ownRows() {
    const seen = new Set(), rows = [];
    for (const k of [...order].reverse()) { // the best subset first: it is drawn last
      const fresh = Array.from(curves[k].model, (model) => model < 0 || !seen.has(model));
      if (!state.hidden.has(k)) curves[k].model.forEach((model) => seen.add(model));
      rows[k] = fresh.map((own, row) => own || fresh[row - 1] || fresh[row + 1]);  // lines go on to where curves meet
    }
    return rows;
  }
  function against() {
    const own = ownRows();
    return lines.map(({ curve, set }) => {
      const values = new Array(largest).fill(null);
      curves[curve].n.forEach((n, row) => { if (own[curve][row]) values[n - 1] = visible(curves[curve].torque[set][row]); });
      return values;
    });
  }
  const ring = (u, x, y, of) => {
    if (x === null || y === null || !Number.isFinite(y)) return;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.lineWidth = 2 * devicePixelRatio;
    u.ctx.strokeStyle = of;
    u.ctx.arc(u.valToPos(x, "x", true), u.valToPos(y, "y", true), 6 * devicePixelRatio, 0, 7);
    u.ctx.stroke();
    u.ctx.restore();
  };
  const upright = (u, x) => {
    const at = u.valToPos(x, "x", true);
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.setLineDash([4, 4]);
    u.ctx.strokeStyle = colour("--soft");
    u.ctx.moveTo(at, u.bbox.top);
    u.ctx.lineTo(at, u.bbox.top + u.bbox.height);
    u.ctx.stroke();
    u.ctx.restore();
  };
  const errorChart = plot(part("error-chart"), 280, {
    scales: { x: { time: false, range: [0, largest + 1] }, y: errorScale },
    axes: [axis("number of parameters n", { incrs: [1, 2, 5, 10, 20, 50, 100] }), errorAxis("torque error")],
    series: [{}, ...lines.map(({ curve, set }) => ({
      show: !state.hidden.has(curve) && state.sets.has(set),
      stroke: () => shade(curves[curve]), width: isBest(curve) && set === "estimation" ? 3.2 : 1.6, dash: { validation: [5, 4], test: [1, 3] }[set], spanGaps: false, points: { show: set === "estimation", size: 4 },
    }))],
    hooks: { draw: [(u) => {
      const own = curves[state.curve];
      upright(u, own.n[state.row]);
      ring(u, own.n[state.row], visible(own.torque.estimation[state.row]), shade(own));
    }] },
  }, [ns, ...against()]);
  pointing(errorChart, () => shownCurves().flatMap((k) => SETS.filter((s) => state.sets.has(s)).flatMap((set) =>
    curves[k].n.map((n, row) => ({ x: n, y: visible(curves[k].torque[set][row]), curve: k, row, text: spoken(k, row) })))
  ).filter((p) => p.y !== null), part("error-spot"));
  followers.push(() => errorChart.redraw(false, false));

  // The legend switches curves and sets.
  const legend = part("legend");
  const toggled = (button, on) => button.setAttribute("aria-pressed", String(on));
  function apply() {
    errorChart.setData([ns, ...against()]);
    lines.forEach(({ curve, set }, k) => {
      const show = !state.hidden.has(curve) && state.sets.has(set);
      if (errorChart.series[k + 1].show !== show) errorChart.setSeries(k + 1, { show });
    });
    for (const chart of Object.values(costCharts)) {
      curves.forEach((_, k) => chart.setSeries(k + 1, { show: !state.hidden.has(k) }));
    }
  }
  curves.forEach((c, k) => {
    const mark = element("i");
    mark.style.background = shade(c);
    dark.addEventListener("change", () => { mark.style.background = shade(c); });
    const button = element("button", { type: "button" }, mark, c.names.join(", "));
    toggled(button, !state.hidden.has(k));
    button.addEventListener("click", () => {
      const off = state.hidden.has(k);
      off ? state.hidden.delete(k) : state.hidden.add(k);
      toggled(button, off);
      apply();
    });
    legend.append(button);
  });
  SETS.forEach((set) => {
    const button = element("button", { type: "button", className: "set" }, DASHED[set]);
    toggled(button, state.sets.has(set));
    button.addEventListener("click", () => {
      const on = state.sets.has(set);
      on ? state.sets.delete(set) : state.sets.add(set);
      toggled(button, !on);
      apply();
    });
    legend.append(button);
  });

  // Error against operations: a point for every model, the front, and functions with pruned terms.
  const costCharts = {};
  function costChart(key, label) {
    const all = curves.flatMap((c, k) => c.n.map((_, row) => ({ x: c.operations[key][row], y: visible(c.torque.estimation[row]), curve: k, row, text: spoken(k, row) }))).filter((p) => p.x !== null && p.y !== null);
    const [counts, found] = data.terms[key] ?? [[], []];
    const terms = counts.map((x, k) => ({ x, y: visible(found[k]), terms: true, text: `pruned terms: ${x} operations, ${percent(found[k])}` }));
    const points = [...all, ...terms].sort((a, b) => a.x - b.x || b.y - a.y);
    let best = Infinity;
    const front = points.map((p) => (p.terms || p.y >= best ? null : (best = p.y)));
    const series = curves.map((_, k) => points.map((p) => (p.curve === k ? p.y : null)));
    const dots = (stroke) => ({ stroke, paths: () => null, points: { show: true, size: 5, stroke, fill: stroke } });
    const line = (stroke, dash) => ({ stroke, width: 1.6, dash, spanGaps: true, points: { show: false } });
    const chart = plot(part(`${key}-chart`), 260, {
      scales: { x: { time: false }, y: errorScale },
      axes: [axis(`operations of ${label}`), errorAxis("torque error, estimation")],
      series: [{}, ...curves.map((c, k) => ({ ...dots(() => shade(c)), show: !state.hidden.has(k) })),
        { ...line(() => colour("--ink")), paths: uPlot.paths.stepped({ align: 1 }) },
        { ...line(() => colour("--blue"), [2, 3]), points: { show: true, size: 5, stroke: () => colour("--blue"), fill: () => colour("--card") } }],
      hooks: { draw: [(u) => {
        const own = curves[state.curve];
        ring(u, own.operations[key][state.row], visible(own.torque.estimation[state.row]), shade(own));
      }] },
    }, [points.map((p) => p.x), ...series, front, points.map((p) => (p.terms ? p.y : null))]);
    pointing(chart, () => points.filter((p) => p.terms || !state.hidden.has(p.curve)), part(`${key}-spot`));
    followers.push(() => chart.redraw(false, false));
    costCharts[key] = chart;
  }
  if (data.counted) {
    costChart("inverse", data.functions[0]);
    costChart("direct", data.functions[1]);
  }
  for (const name of ["error-chart", "inverse-chart", "direct-chart"]) {
    const place = part(name);
    const names = () => curves.flatMap((c, k) => (state.hidden.has(k) ? [] : [[c.names.join(", "), shade(c)]]));
    if (place) savable(place, `${name}.png`, () => picture([place.querySelector("canvas")], names()));
  }

  // Torques along the motion with what is missed; drawn when they come into view.
  const first = data.measured ? "measured" : "as given";
  const seen = new Set();
  const torqueCharts = joints.map((joint) => {
    const place = element("div", { className: "joint" });
    const unit = joint.unit ? `, ${joint.unit}` : "";
    place.append(element("h4", { textContent: `${joint.name}${unit}` }));
    const upper = element("div"), lower = element("div");
    place.append(upper, lower);
    part("torques").append(place);
    const given = Float64Array.from({ length: nSamples }, (_, t) => motion.tau[t * nDof + joint.index]);
    const names = () => [[`${joint.name}${unit}, ${first}`, colour("--blue")], [`${curves[state.curve].names[0]}:${curves[state.curve].n[state.row]}`, colour("--ink")], ["error", colour("--bad")]];
    savable(place, `torque-${joint.name}.png`, () => picture([upper, lower].map((one) => one.querySelector("canvas")), names()));
    let charts = null;
    const show = (model) => {
      const values = torque(model, joint.index), other = state.other;
      const pinned = other ? torque(modelOf(curves[other.curve], other.row), joint.index) : new Array(nSamples).fill(null);
      const missed = values.map((v, t) => given[t] - v);
      if (charts) {
        charts[0].setData([motion.time, given, pinned, values]);
        charts[1].setData([motion.time, missed]);
        return;
      }
      const numbers = (u, ticks) => ticks.map((v) => `${Number(v.toPrecision(3))}`);
      const shared = { scales: { x: { time: false } }, cursor: { drag: { x: true, y: false }, sync: { key: "time" } } };
      charts = [
        plot(upper, 120, { ...shared, axes: [axis(undefined, { values: (u, t) => t.map(() => ""), size: 8 }), axis(undefined, { size: 60, values: numbers })],
          series: [{}, { stroke: () => colour("--blue"), width: 1.8 }, { stroke: () => colour("--orange"), width: 1.4 }, { stroke: () => colour("--ink"), width: 1.2, dash: [5, 4] }] }, [motion.time, given, pinned, values]),
        plot(lower, 70, { ...shared, axes: [axis(undefined, { size: 26 }), axis(undefined, { size: 60, space: 11, values: numbers })],
          series: [{}, { stroke: () => colour("--bad"), width: 1.2 }] }, [motion.time, missed]),
      ];
    };
    return { place, show };
  });
  part("first").textContent = first;
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const chart = torqueCharts.find((c) => c.place === entry.target);
      entry.isIntersecting ? seen.add(chart) : seen.delete(chart);
      if (entry.isIntersecting) chart.show(modelOf(curves[state.curve], state.row));
    }
  }, { rootMargin: "100px" });
  torqueCharts.forEach((chart) => watcher.observe(chart.place));
  // On paper nothing is scrolled to.
  addEventListener("beforeprint", () => torqueCharts.forEach((chart) => chart.show(modelOf(curves[state.curve], state.row))));
  followers.push((curve, row, model) => seen.forEach((chart) => chart.show(model)));

  // ---- the mechanism, moving

  const FAR = 3; // times its reach: where it is seen from

  if (figure) mechanism(part("mechanism"));
  function mechanism(place) {
    place.hidden = false;
    const canvas = place.querySelector("canvas");
    savable(place, "mechanism.png", () => picture([canvas]));
    const [select, button, time] = ["select", "button", "input"].map((name) => place.querySelector(name));
    const nPoints = figure.count;
    const points = new Float32Array(figure.points.length);
    for (let k = 0; k < points.length; k++) points[k] = figure.low[k % 3] + figure.points[k] * figure.step;
    // Of each motion where its frames begin, and how many there are.
    let begin = 0;
    const motions = figure.motions.map(({ name, frames }) => ({ name, frames, begin: (begin += frames) - frames }));
    select.replaceChildren(...motions.map(({ name }, k) => new Option(name, k)));
    select.hidden = motions.length < 2;
    let now = motions[0];
    let [middle, reach, floor] = extent();
    const view = { azimuth: widest() + 0.35, elevation: 0.38, frame: 0, playing: false, drag: null, zoom: 1 };
    let shares = new Map();
    time.max = now.frames - 1;
    view.frame = mostSpread();
    time.value = view.frame;
    function extent() {
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let k = 3 * now.begin * nPoints; k < 3 * (now.begin + now.frames) * nPoints; k++) {
        if (points[k] < low[k % 3]) low[k % 3] = points[k];
        if (points[k] > high[k % 3]) high[k % 3] = points[k];
      }
      return [low.map((v, k) => (v + high[k]) / 2), Math.max(...low.map((v, k) => high[k] - v), 1e-9), low[2]];
    }
    function mostSpread() {
      let [best, most] = [0, -1];
      for (let f = now.begin; f < now.begin + now.frames; f++) {
        let spread = 0;
        for (const [a, b] of figure.lines) {
          for (const k of [a, b]) for (let i = 0; i < 3; i++) spread += Math.abs(points[3 * (f * nPoints + k) + i] - points[3 * f * nPoints + i]);
        }
        if (spread > most) [best, most] = [f - now.begin, spread];
      }
      return best;
    }
    // From where the motion is seen from its broad side.
    function widest() {
      let [xx, xy, yy] = [0, 0, 0];
      for (let k = 0; k < points.length / 3; k++) {
        const [x, y] = [points[3 * k] - middle[0], points[3 * k + 1] - middle[1]];
        [xx, xy, yy] = [xx + x * x, xy + x * y, yy + y * y];
      }
      return Math.atan2(2 * xy, xx - yy) / 2 - Math.PI / 2;
    }
    function draw() {
      const scale = window.devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (canvas.width !== width * scale) [canvas.width, canvas.height] = [width * scale, height * scale];
      const context = canvas.getContext("2d");
      context.setTransform(scale, 0, 0, scale, 0, 0);
      context.clearRect(0, 0, width, height);
      const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
      const zoom = (0.9 * view.zoom * Math.min(width, height)) / reach;
      const placed = (...point) => {
        const [x, y, z] = point.map((value, i) => value - middle[i]);
        const across = -sa * x + ca * y, near = ca * x + sa * y;
        const depth = ce * near + se * z;
        const size = zoom / (1 - depth / (FAR * reach));
        return [width / 2 + size * across, height / 2 - size * (ce * z - se * near), depth];
      };
      const project = (k) => {
        const at = 3 * ((now.begin + view.frame) * nPoints + k);
        return placed(points[at], points[at + 1], points[at + 2]);
      };
      // The ground, as a grid under all that moves.
      context.lineWidth = 1;
      context.strokeStyle = colour("--line");
      const half = 0.6 * reach;
      const line = (from, to) => { context.beginPath(); context.moveTo(from[0], from[1]); context.lineTo(to[0], to[1]); context.stroke(); };
      for (let i = 0; i <= 8; i++) {
        const at = half * (i / 4 - 1), [mx, my] = middle;
        line(placed(mx + at, my - half, floor), placed(mx + at, my + half, floor));
        line(placed(mx - half, my + at, floor), placed(mx + half, my + at, floor));
      }
      const pieces = figure.lines.map(([a, b, owner, kind]) => ({ from: project(a), to: project(b), owner, kind }));
      pieces.sort((p, q) => p.from[2] + p.to[2] - q.from[2] - q.to[2]);
      context.lineCap = "round";
      const [none, all, unknown] = [colour("--orange"), colour("--blue"), colour("--soft")];
      for (const piece of pieces) {
        const share = shares.get(figure.owners[piece.owner]);
        context.strokeStyle = share === undefined ? unknown : `color-mix(in oklch, ${all} ${Math.round(100 * share)}%, ${none})`;
        context.lineWidth = { link: 7, mass: 4, loop: 5, rail: 2, axis: 11 }[piece.kind];
        line(piece.from, piece.to);
      }
    }
    followers.push((curve, row, model) => {
      const kept = new Set(model.columns);
      const counts = new Map();
      columns.forEach((column, k) => {
        const [mine, all] = counts.get(column.owner) ?? [0, 0];
        counts.set(column.owner, [mine + kept.has(k), all + 1]);
      });
      shares = new Map(Array.from(counts, ([owner, [mine, all]]) => [owner, mine / all]));
      draw();
    });
    time.addEventListener("input", () => { view.frame = +time.value; draw(); });
    select.addEventListener("change", () => {
      now = motions[select.value];
      [middle, reach, floor] = extent();
      time.max = now.frames - 1;
      time.value = view.frame = Math.min(view.frame, now.frames - 1);
      draw();
    });
    let last = 0;
    const step = (instant) => {
      if (!view.playing) return;
      if (instant - last > 60) {
        last = instant;
        time.value = view.frame = (view.frame + 1) % now.frames;
        draw();
      }
      requestAnimationFrame(step);
    };
    button.addEventListener("click", () => {
      view.playing = !view.playing;
      button.textContent = view.playing ? "Pause" : "Play";
      requestAnimationFrame(step);
    });
    canvas.addEventListener("pointerdown", (event) => { view.drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { view.drag = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!view.drag) return;
      turn((event.clientX - view.drag[0]) * 0.01, (event.clientY - view.drag[1]) * 0.01);
      view.drag = [event.clientX, event.clientY];
    });
    function turn(across, up) {
      view.azimuth -= across;
      view.elevation = Math.min(1.5, Math.max(-1.5, view.elevation + up));
      draw();
    }
    function closer(times) {
      view.zoom = Math.min(8, Math.max(0.3, view.zoom * times));
      draw();
    }
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas) return; // else the page is scrolled
      event.preventDefault();
      closer(Math.exp(-event.deltaY / 400));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const times = { "+": 1.2, "=": 1.2, "-": 1 / 1.2 }[event.key];
      if (times) closer(times);
      const way = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (!way) return;
      event.preventDefault();
      turn(...way);
    });
    new ResizeObserver(draw).observe(canvas);
    dark.addEventListener("change", draw);
  }

  dark.addEventListener("change", () => drawn.forEach((chart) => chart.redraw()));
  addEventListener("hashchange", () => { if (MODEL.test(decodeURIComponent(location.hash))) { fromAddress(); follow(); } });
  fromAddress();
  follow();
  // The browser has gone to a section before there was an explorer above it, or when it was hidden.
  document.getElementById(MODEL.test(decodeURIComponent(location.hash)) ? "explorer" : location.hash.slice(1))?.scrollIntoView();
  root.dataset.ready = "true";
})();
