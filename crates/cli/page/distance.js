"use strict";
// Plot of the smallest distance between the collision shapes of a robot.

/** Makes the plot of `data.apart`. `on` is as for `makePlots`. Returns the functions that the player and the theme call. */
function makeDistancePlot({ apart, times }, on) {
  const { distances, nearest, pairs } = apart, host = document.getElementById("plot-distance");
  const least = distances.indexOf(Math.min(...distances));
  let plot = null, now = times[0];

  function rebuild() {
    plot?.destroy();
    const line = { stroke: css("--accent"), width: 2, pxAlign: 0, points: { show: times.length < 3 } };
    const touching = { stroke: css("--bad"), width: 1.25, dash: [6, 4], points: { show: false } };
    const low = Math.min(0, ...distances), high = Math.max(0, ...distances), room = 0.06 * (high - low) || 0.01;
    const columns = [times, distances, times.map(() => 0)];
    plot = timePlot({ id: "plot-distance", label: "distance (m)", columns, series: [line, touching], times, more: { y: { range: () => [low - room, high + room] } } }, on);
    show(now);
  }

  /** Moves the cursor to time t, and names the nearest pair there. */
  function show(t) {
    now = t;
    plot.setCursor({ left: plot.valToPos(t, "x"), top: 0 }, false);
    const { k } = knotAt(times, t), [first, second] = pairs[nearest[k]];
    key.textContent = `${length(distances[k])}: ${first} and ${second}`;
  }

  const key = document.getElementById("key-distance");
  const [first, second] = pairs[nearest[least]];
  host.setAttribute("aria-label", `Smallest distance over ${times.at(-1).toFixed(2)} s. The smallest value is ${length(distances[least])}, at ${times[least].toFixed(2)} s, between ${first} and ${second}.`);
  rebuild();
  new ResizeObserver(() => {
    plot.setSize({ width: host.clientWidth, height: plot.height });
    show(now);
  }).observe(host);
  return { show, rebuild };
}
