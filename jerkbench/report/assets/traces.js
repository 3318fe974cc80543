"use strict";
{
  const traces = JSON.parse(document.getElementById("traces-data").textContent);
  const byId = (id) => document.getElementById(id);
  const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function times(scenario) {
    return scenario.lines[0].error.map((_, place) => scenario.start + (place + 0.5) * scenario.step);
  }

  function shade(scenario) {
    return (plot) => {
      const { ctx, bbox } = plot;
      ctx.save();
      ctx.fillStyle = ink("--outage");
      for (const [begin, end] of scenario.outages) {
        const [left, right] = [begin, end].map((t) => plot.valToPos(t, "x", true));
        const from = Math.max(left, bbox.left);
        const width = Math.min(right, bbox.left + bbox.width) - from;
        if (width > 0) ctx.fillRect(from, bbox.top, width, bbox.height);
      }
      ctx.restore();
    };
  }

  const short = (value) => (value === null || value === undefined ? "–" : Number(value.toPrecision(3)).toString());
  const tick = (values) => values.map((value) => (value === null ? "" : Number(value.toPrecision(6)).toString()));

  function axis(label, more) {
    const line = { stroke: ink("--line"), width: 1 };
    return { label, stroke: ink("--quiet"), grid: line, ticks: line, font: "12px system-ui", labelFont: "12px system-ui", ...more };
  }

  function plotted(box, scenario, series, label, { log, height, zoomed }) {
    const options = {
      width: Math.max(240, box.clientWidth),
      height,
      scales: { x: { time: false }, y: log ? { distr: 3, log: 10 } : {} },
      cursor: { drag: { x: true, y: false }, sync: { key: "errors" } },
      axes: [axis("Time [s]", { values: (_, all) => tick(all), size: 34 }), axis(label, { values: (_, all) => tick(all), size: 62 })],
      series: [
        { label: "time", value: (_, t) => (t === null ? "–" : `${t.toFixed(1)} s`) },
        ...series.map((one) => ({ label: one.name, stroke: one.colour, dash: one.dash, width: 1.4, points: { show: false }, value: (_, v) => short(v) })),
      ],
      legend: { markers: { dash: (_, k) => (k && series[k - 1].dash.length ? "dashed" : "solid") } },
      hooks: {
        drawClear: [shade(scenario)],
        setScale: [(plot, key) => key === "x" && scaled(plot, zoomed)],
      },
    };
    return new uPlot(options, [times(scenario), ...series.map((one) => one.values)], box);
  }

  function scaled(plot, zoomed) {
    const { min, max } = plot.scales.x;
    plot.root.parentElement.dataset.range = `${min} ${max}`;
    zoomed(plot);
  }

  let plots = [];
  let moving = false;

  function together(plot) {
    if (moving) return;
    moving = true;
    const { min, max } = plot.scales.x;
    for (const other of plots) if (other !== plot) other.setScale("x", { min, max });
    moving = false;
  }

  function range(plot) {
    const all = plot.data[0];
    return [all[0], all[all.length - 1]];
  }

  function move(how) {
    const [plot] = plots;
    const [first, last] = range(plot);
    const { min, max } = plot.scales.x;
    const width = max - min;
    const shift = { in: [width / 4, -width / 4], out: [-width / 2, width / 2], left: [-width / 4, -width / 4], right: [width / 4, width / 4], whole: [first - min, last - max] }[how];
    let [from, to] = [min + shift[0], max + shift[1]];
    if (how === "left" && from < first) [from, to] = [first, first + width];
    if (how === "right" && to > last) [from, to] = [last - width, last];
    plot.setScale("x", { min: Math.max(first, from), max: Math.min(last, to) });
  }

  function chosen() {
    const scenario = traces.scenarios[byId("trace-scenario").selectedIndex];
    return [scenario, scenario.lines[byId("trace-a").selectedIndex], scenario.lines[byId("trace-b").selectedIndex]];
  }

  function draw() {
    const [scenario, a, b] = chosen();
    const kept = plots.length ? { ...plots[0].scales.x } : null;
    for (const plot of plots) plot.destroy();
    const lines = a === b ? [a] : [a, b];
    const series = lines.map((one) => ({ ...one, values: one.error }));
    const log = byId("trace-log").checked;
    const quotient = b.error.map((value, place) => (value === null || !a.error[place] ? null : value / a.error[place]));
    const ratio = [{ name: `${b.name} / ${a.name}`, colour: ink("--ink"), dash: [], values: quotient }];
    plots = [];
    const upper = plotted(byId("trace-error"), scenario, series, "Position error [m]", { log, height: 300, zoomed: together });
    const lower = plotted(byId("trace-ratio"), scenario, ratio, "Ratio of the errors", { log: true, height: 190, zoomed: together });
    plots = [upper, lower];
    if (kept && scenario === draw.scenario) upper.setScale("x", { min: kept.min, max: kept.max });
    draw.scenario = scenario;
    const apart = Math.max(...quotient.filter((value) => value > 0).map((value) => Math.abs(Math.log(value))));
    const same = a !== b && apart < 0.01 ? "The two lines coincide within 1 %. " : "";
    byId("trace-note").textContent = `${same}${scenario.draw[0].toUpperCase()}${scenario.draw.slice(1)}; largest error of each ${short(scenario.step)} s. Shaded: outages. `
      + "Drag to zoom both plots; double-click to reset. Keyboard: arrows, +, -, and 0 to reset.";
  }

  function fill(select, names, place) {
    select.replaceChildren(...names.map((name) => new Option(name)));
    select.selectedIndex = Math.min(place, names.length - 1);
  }

  function methods() {
    const scenario = traces.scenarios[byId("trace-scenario").selectedIndex];
    const names = scenario.lines.map((one) => one.name);
    const [a, b] = [byId("trace-a").value, byId("trace-b").value].map((name) => names.indexOf(name));
    const baseline = names.findIndex((name) => name.startsWith("baseline + none"));
    fill(byId("trace-a"), names, Math.max(a, 0));
    fill(byId("trace-b"), names, b >= 0 ? b : Math.max(baseline, 1));
    draw();
  }

  const KEYS = { "+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", 0: "whole" };

  function start() {
    fill(byId("trace-scenario"), traces.scenarios.map((one) => one.name), 0);
    byId("trace-scenario").addEventListener("change", methods);
    for (const id of ["trace-a", "trace-b", "trace-log"]) byId(id).addEventListener("change", draw);
    for (const one of document.querySelectorAll("[data-zoom]")) one.addEventListener("click", () => move(one.dataset.zoom));
    for (const id of ["trace-error", "trace-ratio"]) {
      byId(id).addEventListener("keydown", (event) => {
        if (KEYS[event.key] === undefined) return;
        event.preventDefault();
        move(KEYS[event.key]);
      });
    }
    methods();
    let waiting = 0;
    window.addEventListener("resize", () => {
      clearTimeout(waiting);
      waiting = setTimeout(draw, 100);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  }

  window.addEventListener("beforeprint", () => {
    for (const one of document.querySelectorAll("#section-figures details, #section-findings details")) one.open = true;
  });
  if (traces.scenarios.length) start();
}
