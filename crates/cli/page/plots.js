"use strict";
// Plots: joint positions, velocities and torques, the multipliers of their limits, and the solver's progress.

// Hues that remain distinguishable for colour-blind readers and on both backgrounds. Red is reserved for exceeded limits.
const HUES = {
  light: ["#2563c9", "#d0700b", "#12805c", "#8b4fd1", "#0a86a8", "#c0307f", "#7d7a10", "#7a5540"],
  dark: ["#79aefc", "#f5a04c", "#54cf9b", "#bd97ff", "#48cbe6", "#f584bd", "#d3cf55", "#cfa58a"],
};
const DASHES = [[], [9, 4], [3, 3], [12, 3, 3, 3]]; // after eight joints, the hues repeat with dashes

/** Returns hue and dash of joint j. */
function strokeOf(j) {
  const hues = HUES[matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"];
  return { colour: hues[j % hues.length], dash: DASHES[Math.floor(j / hues.length) % DASHES.length] };
}

/** Returns the three quantities: unit, limits and values of each joint. */
function quantitiesOf(data) {
  const rate = (unit) => `${unit}/s`;
  const effort = (unit) => (unit === "m" ? "N" : "N·m");
  return [
    { id: "q", what: "position", rows: data.q, unit: (u) => u, limits: (joint) => [joint.lower, joint.upper] },
    { id: "v", what: "velocity", rows: data.v, unit: rate, limits: ({ velocity: m }) => [m == null ? null : -m, m] },
    { id: "tau", what: "torque", rows: data.tau, unit: effort, limits: (j) => [j.effort_lower, j.effort_upper], held: true },
  ];
}

/** Returns the multipliers of the limits as quantities without limits of their own; none where no bound is reached. */
function multipliersOf(data) {
  const reached = quantitiesOf(data).filter(({ id }) => data.multipliers?.[id]);
  return reached.map(({ id, what, unit, held }) => ({ id: `limit-${id}`, what: "multiplier", of: what, rows: data.multipliers[id],
    unit: (u) => `1/${unit(u).includes("·") ? `(${unit(u)})` : unit(u)}`.replace(/^1\/(\w+)\/s$/, "s/$1"), limits: () => [null, null], held, apart: true }));
}

/** Returns the position of `value` between its limits: −1 at the lower, 1 at the upper limit; null without limits. */
function shareOf(value, [lower, upper]) {
  if (value == null || lower == null || upper == null || upper <= lower) return null;
  return (2 * value - lower - upper) / (upper - lower);
}

function axis(more) {
  const font = "12px system-ui, sans-serif";
  return { stroke: css("--muted"), grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line"), width: 1, size: 5 },
    font, labelFont: font, labelGap: 2, gap: 4, ...more };
}

/**
 * Makes the three plots over time.
 * Callbacks: `on.seek(t)`: the pointer is at time t; `on.hold(yes)`: whether the pointer is over a plot; `on.focus(j)`: the
 * pointer is near the curve of joint j, or near no curve (null).
 */
function makePlots(data, on) {
  const joints = data.joints, times = data.times, last = times.length - 1;
  const quantities = quantitiesOf(data), drawn = [...quantities, ...multipliersOf(data)];
  const side = drawn.length > quantities.length ? 60 : 50; // width of a vertical axis; small multipliers have long labels
  for (const { id } of drawn) document.getElementById(`plot-${id}`).parentElement.hidden = false;
  const mixed = new Set(joints.map((joint) => joint.unit)).size > 1; // with metres and radians, each unit has its own axis
  const hidden = new Set();
  let inShares = false, focus = null, plots = [], now = times[0], zoom = null;

  // A torque acts from its knot to the next knot, so the last torque is drawn to the end of the motion.
  const valueAt = (quantity, k, j) => quantity.rows[Math.min(k, quantity.rows.length - 1)]?.[j] ?? null;

  function build(quantity) {
    const host = document.getElementById(`plot-${quantity.id}`);
    const shares = inShares && !quantity.apart; // a multiplier has no limits of its own
    const columns = joints.map((joint, j) => times.map((_, k) => {
      const value = valueAt(quantity, k, j);
      if (!shares) return value;
      const share = shareOf(value, quantity.limits(joint));
      return share == null ? null : 100 * share;
    }));
    const scaleOf = (joint) => (shares || joint.unit === joints[0].unit ? "y" : "y2");
    const inScale = (key) => joints.map((joint, j) => j).filter((j) => scaleOf(joints[j]) === key);

    // The range covers all shown curves, and also their limits, unless the limits would flatten the curves.
    function range(key) {
      let low = Infinity, high = -Infinity;
      const take = (y) => { if (y != null) { low = Math.min(low, y); high = Math.max(high, y); } };
      const shown = inScale(key).filter((j) => !hidden.has(j));
      for (const j of shown) columns[j].forEach(take);
      if (shares) [-100, 100].forEach(take);
      else if (quantity.apart) take(0);
      else {
        const reach = 3 * Math.max(Math.abs(low), Math.abs(high));
        for (const j of shown) for (const limit of quantity.limits(joints[j])) if (Math.abs(limit) <= reach) take(limit);
      }
      if (!(low <= high)) return [-1, 1];
      // If zero means rest, both axes have their zero at the same height.
      if (mixed && quantity.id !== "q") low = -(high = Math.max(high, -low));
      const room = 0.05 * (high - low) || 0.1 * Math.abs(high) || 1;
      return [low - room, high + room];
    }

    function drawLimits(u) {
      const { ctx } = u, { left, top, width, height } = u.bbox, ratio = devicePixelRatio;
      ctx.save();
      ctx.beginPath();
      ctx.rect(left, top, width, height);
      ctx.clip();
      const line = (value, scale) => {
        const y = Math.round(u.valToPos(value, scale, true)) + 0.5;
        ctx.beginPath();
        ctx.moveTo(left, y);
        ctx.lineTo(left + width, y);
        ctx.stroke();
      };
      ctx.lineWidth = 1.25 * ratio;
      ctx.setLineDash([5 * ratio, 4 * ratio]);
      if (shares) {
        ctx.fillStyle = css("--bad");
        ctx.globalAlpha = 0.07;
        const upper = u.valToPos(100, "y", true), lower = u.valToPos(-100, "y", true);
        ctx.fillRect(left, top, width, upper - top);
        ctx.fillRect(left, lower, width, top + height - lower);
        ctx.globalAlpha = 0.8;
        ctx.strokeStyle = css("--bad");
        line(100, "y");
        line(-100, "y");
      } else {
        joints.forEach((joint, j) => {
          if (hidden.has(j)) return;
          ctx.strokeStyle = strokeOf(j).colour;
          ctx.globalAlpha = focus == null ? 0.55 : focus === j ? 1 : 0.1;
          for (const limit of quantity.limits(joint)) if (limit != null) line(limit, scaleOf(joint));
        });
      }
      ctx.restore();
    }

    // Marks the knots outside the limits, on either scale.
    function drawBreaches(u) {
      const { ctx } = u, ratio = devicePixelRatio;
      ctx.save();
      ctx.setLineDash([]); // otherwise the dashes of the last curve would apply
      ctx.fillStyle = css("--bad");
      ctx.strokeStyle = css("--card");
      ctx.lineWidth = 1.5 * ratio;
      for (const { what, joint: name, at_knot: k } of data.violations) {
        const j = joints.findIndex((joint) => joint.name === name);
        if (what !== quantity.what || j < 0 || hidden.has(j) || columns[j][k] == null) continue;
        ctx.beginPath();
        ctx.arc(u.valToPos(times[k], "x", true), u.valToPos(columns[j][k], scaleOf(joints[j]), true), 4.5 * ratio, 0, 7);
        ctx.fill();
        ctx.stroke();
      }
      ctx.restore();
    }

    const label = (unit) => `${quantity.what} (${shares ? "% of limit" : quantity.unit(unit)})`;
    const second = mixed && joints.find((joint) => joint.unit !== joints[0].unit)?.unit;
    const values = quantity.apart && { values: (_, splits) => splits.map((y) => brief(y)) }; // multipliers may be small
    const axes = [
      axis({ label: "time (s)", labelSize: 18, size: 26 }),
      axis({ scale: "y", label: label(joints[0]?.unit ?? ""), labelSize: 20, size: side, ...values }),
    ];
    if (mixed) axes.push(axis({ scale: shares ? "y" : "y2", side: 1, size: side, labelSize: 20, label: shares ? " " : label(second), grid: { show: false }, ...values, ...(shares && { values: () => [], ticks: { show: false } }) }));

    const u = new uPlot({
      width: host.clientWidth || 600,
      height: 216,
      legend: { show: false },
      padding: [8, mixed ? 0 : 12, 0, 0],
      scales: {
        x: { time: false, range: (_, low, high) => (high > low ? [low, high] : [low - 0.5, low + 0.5]) },
        y: { range: () => range("y") },
        ...(mixed && !shares && { y2: { range: () => range("y2") } }),
      },
      focus: { alpha: 0.18 },
      cursor: {
        y: false,
        focus: { prox: -1 },
        points: { size: 7 },
        drag: { x: true, y: false, dist: 6 },
        bind: { mouseleave: () => () => null }, // the cursor shows the playback time, so it stays when the pointer leaves
      },
      axes,
      series: [{}, ...joints.map((joint, j) => {
        const { colour, dash } = strokeOf(j);
        return { label: joint.name, scale: scaleOf(joint), stroke: colour, width: 2, pxAlign: 0, dash, show: !hidden.has(j), points: { show: last < 2 },
          ...(quantity.held && { paths: uPlot.paths.stepped({ align: 1 }) }) };
      })],
      hooks: {
        drawAxes: [drawLimits],
        draw: [drawBreaches],
        setScale: [(self, key) => { if (key === "x") follow(self); }],
      },
    }, [times, ...columns], host);
    host.setAttribute("aria-label", quantity.apart ? `Multipliers of the ${quantity.of} limits of ${joints.length} joints over ${times[last].toFixed(2)} s. The table of reached bounds has the largest numbers.` : `${quantity.what} of ${joints.length} joints over ${times[last].toFixed(2)} s, with their limits. The joint table has the numbers at the playback time.`);
    wire(u, quantity, columns, scaleOf);
    return u;
  }

  function wire(u, quantity, columns, scaleOf) {
    const tag = document.createElement("div");
    tag.className = "tag";
    tag.hidden = true;
    u.over.append(tag);
    const point = (event) => {
      const box = u.over.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
      const t = u.posToVal(Math.min(Math.max(x, 0), box.width), "x");
      on.seek(t);
      const { k, s } = knotAt(times, t);
      let near = null, distance = 16;
      joints.forEach((joint, j) => {
        if (hidden.has(j) || columns[j][k] == null) return;
        const slope = quantity.held ? 0 : (columns[j][Math.min(k + 1, last)] - columns[j][k]) * s;
        const d = Math.abs(u.valToPos(columns[j][k] + slope, scaleOf(joint)) - y);
        if (d < distance) [near, distance] = [j, d];
      });
      on.focus(near);
      tag.hidden = near == null;
      if (near == null) return;
      tag.style.setProperty("--tint", strokeOf(near).colour);
      const unit = quantity.unit(joints[near].unit);
      tag.textContent = `${joints[near].name}  ${number(valueAt(quantity, k, near))} ${unit}`;
      const left = x + 14 + tag.offsetWidth < box.width ? x + 14 : x - 14 - tag.offsetWidth;
      tag.style.transform = `translate(${left}px, ${Math.min(Math.max(y - 32, 0), box.height - 26)}px)`;
    };
    u.over.addEventListener("pointerenter", () => on.hold(true));
    u.over.addEventListener("pointerdown", (event) => { on.hold(true); point(event); });
    u.over.addEventListener("pointermove", point);
    for (const leave of ["pointerleave", "pointercancel"]) {
      u.over.addEventListener(leave, () => { tag.hidden = true; on.focus(null); on.hold(false); });
    }
  }

  // All plots share one zoom, so that they show the same part of the motion.
  function follow(from) {
    if (!plots.includes(from)) return;
    const { min, max } = from.scales.x;
    zoom = min > times[0] || max < times[last] ? { min, max } : null;
    for (const u of plots) if (u !== from) u.setScale("x", { min, max }); // no endless recursion: uPlot calls no hook if the scale is unchanged
    show(now);
  }

  /** Moves the cursor of every plot to time t. */
  function show(t) {
    now = t;
    for (const u of plots) {
      // uPlot's own sizes: querying the document would force a layout at every frame
      const left = u.valToPos(t, "x"), width = u.bbox.width / uPlot.pxRatio, height = u.bbox.height / uPlot.pxRatio;
      u.setCursor({ left: left < 0 || left > width + 0.5 ? -10 : left, top: height / 2 }, false);
    }
  }

  function rebuild() {
    const kept = zoom;
    for (const u of plots) u.destroy();
    plots = [];
    plots = drawn.map(build);
    if (kept) plots[0].setScale("x", kept);
    show(now);
  }
  new ResizeObserver(() => {
    for (const u of plots) u.setSize({ width: u.root.parentElement.clientWidth, height: u.height });
    show(now);
  }).observe(document.getElementById("plot-q"));
  rebuild();

  return {
    show,
    rebuild,
    quantities,
    valueAt,
    /** Selects the vertical scale: units, or percent of the limits. */
    scale(shares) { inShares = shares; rebuild(); },
    /** Shows the joints j for which `visible(j)` is true, and hides the others. */
    filter(visible) {
      joints.forEach((_, j) => {
        visible(j) ? hidden.delete(j) : hidden.add(j);
        for (const u of plots) if (u.series[j + 1].show === hidden.has(j)) u.setSeries(j + 1, { show: !hidden.has(j) });
      });
    },
    /** Highlights joint j, or no joint if j is null. */
    focus(j) {
      if (j === focus) return;
      focus = j;
      for (const u of plots) {
        u.setSeries(j == null ? null : j + 1, { focus: true });
        u.redraw(false); // the limits are drawn according to the focus
      }
    },
  };
}

/**
 * Plots columns over the time of the motion, in the element `id`. `columns` begins with times; `series` has the style of each
 * further column, and `more` further scales. `on.seek(t)` and `on.hold(yes)` are as for `makePlots`.
 */
function timePlot({ id, label, columns, series, times, more = {} }, on) {
  const host = document.getElementById(id);
  host.parentElement.hidden = false;
  const u = new uPlot({
    width: host.clientWidth || 600,
    height: 216,
    legend: { show: false },
    padding: [8, 12, 0, 0],
    scales: { x: { time: false, range: () => [times[0], times.at(-1)] }, ...more },
    cursor: { y: false, points: { show: false }, drag: { x: false, y: false }, bind: { mouseleave: () => () => null } },
    axes: [axis({ label: "time (s)", labelSize: 18, size: 26 }), axis({ label, labelSize: 20, size: 50 })],
    series: [{}, ...series],
  }, columns, host);
  const seek = ({ clientX }) => {
    const box = u.over.getBoundingClientRect();
    on.seek(u.posToVal(Math.min(Math.max(clientX - box.left, 0), box.width), "x"));
  };
  u.over.addEventListener("pointerenter", () => on.hold(true));
  u.over.addEventListener("pointermove", seek);
  u.over.addEventListener("pointerdown", seek);
  for (const leave of ["pointerleave", "pointercancel"]) u.over.addEventListener(leave, () => on.hold(false));
  return u;
}

/** Plots cost and gap over the iterations, on logarithmic scales. `on.pick(i)`: the pointer is at row i, or at no row (null). */
function makeProgress(iterations, on) {
  const host = document.getElementById("plot-iterations");
  const x = iterations.map((row) => row.iteration);
  // A closed gap is zero, which has no logarithm. It is drawn one decade below the smallest other value.
  const logarithmic = (values) => {
    const positive = values.filter((y) => y > 0);
    if (!positive.length) return { values, log: false };
    if (values.some((y) => y < 0)) return { values, log: false };
    const floor = 10 ** (Math.floor(Math.log10(Math.min(...positive))) - 1);
    return { values: values.map((y) => (y === 0 ? floor : y)), log: true, floor: values.includes(0) ? floor : null };
  };
  const series = [["cost", "--accent"], ["gap", "--target"]].map(([key, tint]) => ({ key, tint, ...logarithmic(iterations.map((row) => row[key] ?? null)) }));
  let u = null;

  function rebuild() {
    u?.destroy();
    const scale = ({ values, log }) => {
      const known = values.filter((y) => y != null);
      if (!known.length) return { range: [0, 1] };
      const low = Math.min(...known), high = Math.max(...known);
      if (!log) return { range: [low - 0.05 * (high - low || 1), high + 0.05 * (high - low || 1)] };
      const bottom = Math.floor(Math.log10(low) + 1e-9), top = Math.max(Math.ceil(Math.log10(high) - 1e-9), bottom + 1);
      return { distr: 3, log: 10, range: [10 ** bottom, 10 ** top] };
    };
    // Labels whole decades only, as many as there is space for. The value that represents zero is labelled 0.
    const decades = ({ floor }) => (_, splits) => {
      const whole = splits.map((y) => (y > 0 ? Math.log10(y) : NaN)).map((e) => (Math.abs(e - Math.round(e)) < 1e-6 ? Math.round(e) : null));
      const exponents = whole.filter((e) => e != null);
      const every = Math.max(1, Math.ceil((exponents.at(-1) - exponents[0]) / 6));
      return whole.map((e, i) => (e == null ? "" : floor != null && Math.abs(splits[i] / floor - 1) < 1e-6 ? "0" : (e - exponents.at(-1)) % every ? "" : `10${superscript(e)}`));
    };
    const vertical = (s, more) => axis({ scale: s.key, label: s.key, labelSize: 20, size: 48, stroke: css(s.tint), ...(s.log && { values: decades(s), space: 1 }), ...more });
    u = new uPlot({
      width: host.clientWidth || 600,
      height: 240,
      legend: { show: false },
      padding: [8, 0, 0, 0],
      scales: {
        x: { time: false, range: (_, low, high) => (high > low ? [low, high] : [low - 1, low + 1]) },
        cost: scale(series[0]),
        gap: scale(series[1]),
      },
      cursor: { y: false, drag: { x: false, y: false }, points: { size: 8 } },
      axes: [
        axis({ label: "iteration", labelSize: 18, size: 26, incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000] }),
        vertical(series[0], { grid: { stroke: css("--line"), width: 1, filter: wholeDecades(series[0]) }, ticks: { show: false } }),
        vertical(series[1], { side: 1, gap: 9, grid: { show: false }, ticks: { show: false } }),
      ],
      series: [{}, ...series.map(({ key, tint }) => ({ label: key, scale: key, stroke: css(tint), width: 2.25, pxAlign: 0, points: { show: x.length <= 80, size: 6, fill: css(tint) } }))],
      hooks: { setCursor: [(self) => on.pick(self.cursor.left >= 0 ? self.cursor.idx : null)] },
    }, [x, ...series.map((s) => s.values)], host);
  }
  const wholeDecades = ({ log }) => (_, splits) => (log ? splits.map((y) => (Math.abs(Math.log10(y) - Math.round(Math.log10(y))) < 1e-6 ? y : null)) : splits);

  host.setAttribute("aria-label", `Cost and gap over ${iterations.length} iterations, on logarithmic scales. The table below has the numbers.`);
  rebuild();
  new ResizeObserver(() => u.setSize({ width: host.clientWidth, height: u.height })).observe(host);
  return { rebuild };
}

const superscript = (n) => [...String(n)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c])).join("");
