"use strict";
// Plots of a walk: velocities of the trunk with their command, and the computing time of each tick.

/**
 * Makes the plots of `data.walk`. `on.seek(t)`: the pointer is at time t; `on.hold(yes)`: whether the pointer is over a plot.
 * Returns the functions that the player and the theme call.
 */
function makeWalkPlots({ walk, times }, on) {
  const names = ["forwards", "to the left", "turning"], end = times.at(-1);
  const starts = times.slice(0, walk.velocities.length);
  const { ticks } = walk;
  let plots = [], now = times[0];
  const plot = (id, label, columns, series, more) => timePlot({ id, label, columns, series, times, more }, on);

  function rebuild() {
    for (const u of plots) u.destroy();
    const column = (rows, k) => rows.map((row) => row[k]);
    const line = (k, more) => ({ stroke: strokeOf(k).colour, width: 1.5, pxAlign: 0, points: { show: false }, ...more });
    const commanded = names.map((_, k) => line(k, { dash: [6, 4], width: 1.5 }));
    const budget = { stroke: css("--bad"), width: 1.25, dash: [6, 4], points: { show: false } };
    const most = Math.max(ticks.budget_ms, ...ticks.ms);
    plots = [
      plot("plot-speed", "velocity (m/s, rad/s)", [starts, ...names.map((_, k) => column(walk.velocities, k)), ...names.map((_, k) => column(walk.commands, k))],
        [...names.map((_, k) => line(k)), ...commanded]),
    ];
    if (ticks.ms.length) {
      plots.push(plot("plot-ticks", "time per tick (ms)", [ticks.times, ticks.ms, ticks.ms.map(() => ticks.budget_ms)],
        [{ stroke: css("--accent"), width: 0, pxAlign: 0, points: { show: true, size: 3.5, width: 0, fill: css("--accent") }, paths: () => null }, budget], { y: { range: () => [0, 1.06 * most] } }));
    }
    show(now);
  }

  /** Moves the cursor of both plots to time t. */
  function show(t) {
    now = t;
    for (const u of plots) u.setCursor({ left: u.valToPos(t, "x"), top: 0 }, false);
  }

  const key = document.getElementById("key-speed");
  names.forEach((name, k) => key.append(element("i", { class: "dash", style: `color: var(--hue-${k})` }), element("span", {}, name)));
  key.append(element("span", {}, "· dashed: command"));
  document.getElementById("plot-speed").setAttribute("aria-label", `Velocity of the trunk over ${end.toFixed(1)} s. Mean velocity: ${names.map((name, k) => `${name} ${brief(walk.mean[k])}`).join(", ")}.`);
  document.getElementById("plot-ticks").setAttribute("aria-label", `Computing time of ${ticks.ms.length} ticks. ${ticks.over} take more than ${brief(ticks.budget_ms)} ms.`);
  rebuild();
  new ResizeObserver(() => {
    for (const u of plots) u.setSize({ width: u.root.parentElement.clientWidth, height: u.height });
    show(now);
  }).observe(document.getElementById("plot-speed"));
  return { show, rebuild };
}

/** Writes the facts and badges of a walk. */
function walkHeader({ walk, times, robot }, fact, badge) {
  const { command, mean, ticks, fall } = walk;
  const three = (x) => `(${x.map((number) => number.toFixed(2).replace(/^-(?=[0.]*$)/, "").replace("-", "−")).join(", ")})`;
  $("facts").append(fact("robot", robot), fact("gait", walk.gait), fact("command", `${three(command)} m/s, m/s, rad/s`), fact("mean", three(mean)), fact("duration", `${brief(times.at(-1))} s`));
  if (fall) badge("bad", `Fell after ${fall.time.toFixed(2)} s: ${fall.what}`);
  else badge(times.at(-1) < walk.seconds - 1e-6 ? "warn" : "good", times.at(-1) < walk.seconds - 1e-6 ? `Stopped early, after ${brief(times.at(-1))} s` : `No fall in ${brief(times.at(-1))} s`);
  badge("good", `Largest tilt ${((walk.tilt * 180) / Math.PI).toFixed(1)}°`);
  if (ticks.ms.length) {
    const sorted = [...ticks.ms].sort((a, b) => a - b), share = (100 * ticks.over) / ticks.ms.length;
    badge(share <= 1 ? "good" : "warn", `Tick ${brief(sorted[sorted.length >> 1])} ms (median) of ${brief(ticks.budget_ms)} ms; ${brief(share, 2)} % over`);
  }
}
