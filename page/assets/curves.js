"use strict";
// Curves: any column over any other, small ones over time, convergence and work. uPlot draws axes; in its second mode points may come
// in any order, so that cyclic tests are drawn as they are.
{
  const { element, make, number, scaled, extent, words } = Grainspan;
  const BLUE = "#2456a4";

  const line = (chart, index) => {
    const path = new Path2D();
    uPlot.orient(chart, index, (series, dataX, dataY, scaleX, scaleY, toX, toY, left, top, width, height) => {
      const [xs, ys] = chart.data[index];
      let drawing = false;
      for (let place = 0; place < xs.length; place++) {
        if (xs[place] === null || ys[place] === null) { drawing = false; continue; }
        const x = toX(xs[place], scaleX, width, left), y = toY(ys[place], scaleY, height, top);
        if (drawing) path.lineTo(x, y); else path.moveTo(x, y);
        drawing = true;
      }
    });
    return { stroke: path, fill: null, clip: null, flags: 0 };
  };

  const dots = (chart, index, radius) => {
    const path = new Path2D();
    uPlot.orient(chart, index, (series, dataX, dataY, scaleX, scaleY, toX, toY, left, top, width, height) => {
      const [xs, ys] = chart.data[index];
      for (let place = 0; place < xs.length; place++) {
        if (xs[place] === null || ys[place] === null) continue;
        const x = toX(xs[place], scaleX, width, left), y = toY(ys[place], scaleY, height, top);
        path.moveTo(x + radius, y);
        path.arc(x, y, radius, 0, 2 * Math.PI);
      }
    });
    return path;
  };

  const padded = (range, isFixed) => {
    if (!range) return [0, 1];
    const [low, high] = range;
    const room = high > low ? 0.06 * (high - low) : 0.1 * (Math.abs(high) || 1);
    return [isFixed && low >= 0 && low < 0.3 * high ? 0 : low - room, high + room];
  };

  // Labels of an axis, all with the digits that tell neighbours apart.
  const ticks = (splits) => {
    const known = splits.filter((value) => value !== null);
    const step = known.length > 1 ? Math.abs(known[1] - known[0]) : 1;
    const largest = Math.max(...known.map(Math.abs), 0);
    if (largest >= 1e6 || (largest > 0 && largest < 1e-3)) return splits.map((value) => number(value, 3));
    const exponent = Math.floor(Math.log10(step) + 1e-9);
    const rest = step / 10 ** exponent;
    const digits = Math.max(0, -exponent + (Math.abs(rest - Math.round(rest)) > 1e-6 ? 1 : 0));
    return splits.map((value) => (value === null ? "" : value.toFixed(Math.min(digits, 10))));
  };

  // A chart of lines. `lines`: `{x, y, error, colour, width, dots}`; `axes`: `[{label, log}]` for x and y. `readout` gets the nearest
  // point. `whole`: the values across are whole numbers. Replaces what the place held.
  const chart = (place, lines, axes, height, readout, whole) => {
    const width = Math.max(place.clientWidth, 200);
    const range = (key) => extent(lines.flatMap((one) => one[key]));
    const [across, up] = [range("x"), range("y")];
    const withErrors = extent(lines.flatMap((one) => one.error ? one.y.flatMap((y, i) => y === null || one.error[i] === null ? [y] : [y - one.error[i], y + one.error[i]]) : one.y));
    const axis = (side, title, isLog) => ({
      ...(title ? { label: title } : {}), side, labelSize: 22, labelFont: "12px system-ui, sans-serif", font: "11px system-ui, sans-serif", stroke: "#444", grid: { stroke: "#eceef0", width: 1 }, ticks: { stroke: "#d1d9e0", size: 4 },
      size: side === 3 ? 58 : 34,
      incrs: whole && side === 2 ? [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 100000] : undefined,
      values: (own, splits) => isLog ? splits.map((value) => value !== null && Math.abs(Math.log10(value) % 1) < 1e-9 ? `1e${Math.round(Math.log10(value))}` : "") : ticks(splits),
    });
    const scaleY = axes[1].log
      ? { distr: 3, log: 10, range: () => (up ? [10 ** Math.floor(Math.log10(up[0])), 10 ** Math.ceil(Math.log10(up[1]))] : [1e-6, 1]) }
      : { range: () => padded(withErrors, true) };
    const band = (own) => {
      lines.forEach((one, index) => {
        if (!one.error) return;
        const context = own.ctx;
        const at = (place, side) => [own.valToPos(one.x[place], "x", true), own.valToPos(one.y[place] + side * one.error[place], "y", true)];
        const known = one.x.map((_, i) => i).filter((i) => one.x[i] !== null && one.y[i] !== null && one.error[i] !== null);
        if (known.length < 2) return;
        context.save();
        context.beginPath();
        known.forEach((i, order) => context[order ? "lineTo" : "moveTo"](...at(i, 1)));
        known.reverse().forEach((i) => context.lineTo(...at(i, -1)));
        context.closePath();
        context.fillStyle = "rgba(36,86,164,.22)";
        context.fill();
        context.restore();
      });
    };
    const options = {
      mode: 2, width, height, legend: { show: false }, padding: [8, 12, 0, 0],
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
      scales: { x: { time: false, range: () => padded(across, true) }, y: scaleY },
      axes: [axis(2, axes[0].label, false), axis(3, axes[1].label, axes[1].log)],
      series: [{}, ...lines.map((one) => ({
        stroke: one.colour ?? BLUE, width: one.width ?? 2, points: { show: false },
        paths: line, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }],
      }))],
      hooks: {
        drawClear: [band],
        draw: [(own) => lines.forEach((one, index) => {
          if (!one.dots) return;
          own.ctx.fillStyle = one.colour ?? BLUE;
          own.ctx.fill(dots(own, index + 1, 2.2 * devicePixelRatio));
        })],
      },
    };
    place.replaceChildren();
    const own = new uPlot(options, [null, ...lines.map((one) => [one.x, one.y])], place);
    if (readout) {
      own.over.addEventListener("pointermove", (event) => {
        const box = own.over.getBoundingClientRect();
        const [left, top] = [event.clientX - box.left, event.clientY - box.top];
        let best = null;
        lines.forEach((one, which) => one.x.forEach((x, i) => {
          if (x === null || one.y[i] === null) return;
          const distance = Math.hypot(own.valToPos(x, "x") - left, own.valToPos(one.y[i], "y") - top);
          if (!best || distance < best.distance) best = { distance, which, i };
        }));
        if (best) readout(best.which, best.i);
      });
    }
    return own;
  };

  const column = (history, name) => history.columns.find((one) => one.name === name);

  // Values of a column in a unit that reads well, and its label.
  const prepared = (one) => {
    const range = extent(one.values) ?? [0, 0];
    const scale = scaled(one.unit, Math.max(Math.abs(range[0]), Math.abs(range[1])));
    const times = (values) => values.map((value) => (value === null ? null : value * scale.factor));
    return {
      values: times(one.values), error: one.errors ? times(one.errors) : null, scale,
      label: words(one.name) + (scale.unit ? `, ${scale.unit}` : one.unit === "-" ? ", \u2013" : ""),
    };
  };

  let shown = null;

  const draw = () => {
    if (!shown) return;
    const history = shown;
    const usable = history.columns.filter((one) => one.name !== "stage" && one.values.some((value) => value !== null));
    const steps = history.columns[0]?.values.length ?? 0;
    element("probes-section").hidden = steps < 2;
    if (steps < 2 || usable.length < 2) {
      element("main-curve").replaceChildren(make("p", `No step was accepted${Grainspan.state?.live ? " yet" : ""}: there is no curve to draw.`, { class: "note" }));
      element("small-curves").replaceChildren();
      return;
    }
    const options = usable.map((one) => [one.name, words(one.name)]);
    const x = column(history, Grainspan.fill(element("curve-x"), options, history.main?.[0] ?? "time")) ?? usable[0];
    const y = column(history, Grainspan.fill(element("curve-y"), options, history.main?.[1] ?? usable[1].name)) ?? usable[1];
    const [across, up] = [prepared(x), prepared(y)];
    const readout = (_, i) => {
      const error = up.error?.[i];
      const spread = error === null || error === undefined ? "" : ` \u00b1 ${number(error, 2)}`;
      element("curve-readout").textContent = `step ${history.columns[0].values[i]}: ${words(x.name)} ${number(across.values[i])} ${across.scale.unit}, ${words(y.name)} ${number(up.values[i])}${spread} ${up.scale.unit}`;
    };
    element("band-note").hidden = !up.error;
    const height = Math.min(430, Math.max(240, element("main-curve").clientWidth * 0.85));
    chart(element("main-curve"), [{ x: across.values, y: up.values, error: up.error, dots: steps < 80 }], [{ label: across.label }, { label: up.label }], height, readout);
    small(history);
    work(history);
  };

  // Every probe over time; a click makes it the large one.
  const small = (history) => {
    const time = prepared(column(history, "time"));
    const probes = history.columns.filter((one) => one.kind === "probe" || one.kind === "error");
    const known = probes.filter((one) => one.values.some((value) => value !== null));
    const holder = element("small-curves");
    while (holder.children.length > known.length) holder.lastChild.remove();
    while (holder.children.length < known.length) holder.append(make("div", null, { class: "plot" }));
    known.forEach((one, index) => {
      const place = holder.children[index];
      const of = prepared(one);
      place.title = `Show ${words(one.name)} above`;
      place.onclick = () => { element("curve-y").value = one.name; draw(); };
      chart(place, [{ x: time.values, y: of.values, error: of.error }], [{ label: time.label }, {}], 150);
      place.prepend(make("div", of.label, { class: "small-title" }));
    });
  };

  const work = (history) => {
    const steps = column(history, "step").values;
    const [evaluations, iterations] = ["evaluations", "iterations"].map((name) => column(history, name).values);
    const bars = { x: [], y: [] };
    // Each bar is a line from the axis upwards and back.
    steps.forEach((step, i) => { bars.x.push(step, step, null); bars.y.push(0, evaluations[i], null); });
    const width = Math.max(1, Math.min(8, 0.6 * element("work").clientWidth / Math.max(steps.length, 1)));
    const most = Math.max(Grainspan.largest(evaluations), 1), mostIterations = Math.max(Grainspan.largest(iterations), 1);
    chart(element("work"), [
      { ...bars, colour: "#9db8dd", width },
      { x: steps, y: iterations.map((value) => (value * most) / mostIterations), colour: "#b35900", width: 2, dots: steps.length < 80 },
    ], [{ label: "step" }, { label: "evaluations" }], 210, null, true);
    element("work-note").textContent = `Evaluations of cells (bars), and iterations (line, at most ${mostIterations}).`;
  };

  let log = null;

  const convergence = () => {
    const wanted = Number(element("convergence-steps").value);
    const steps = (log?.steps ?? []).filter((step) => step.iterations.length).slice(-wanted);
    const place = element("convergence");
    if (!steps.length) {
      place.replaceChildren(make("p", "No iteration was logged yet.", { class: "note" }));
      return;
    }
    const lines = steps.map((step, index) => ({
      x: step.iterations.map((_, i) => i + 1),
      y: step.iterations.map(([force]) => (force > 0 ? force : null)),
      colour: `rgba(36,86,164,${0.2 + (0.8 * (index + 1)) / steps.length})`,
      width: 1.2, dots: true,
    })).filter((one) => one.y.some((value) => value !== null));
    if (!lines.length) return;
    const readout = (which, i) => {
      const [force, displacement, rejected] = steps[which].iterations[i] ?? [];
      element("convergence-readout").textContent = `step ${steps[which].step}, iteration ${i + 1}: force ${number(force, 2)}, displacement ${number(displacement, 2)}${rejected ? ", rejected" : ""}`;
    };
    chart(place, lines, [{ label: "iteration" }, { label: "force ratio, \u2013", log: true }], 210, readout, true);
  };

  Grainspan.curves = {
    show(history) { shown = history; draw(); },
    log(found) { log = found; convergence(); },
    redraw() { draw(); convergence(); },
  };
  for (const id of ["curve-x", "curve-y"]) element(id).addEventListener("change", draw);
  element("convergence-steps").addEventListener("change", convergence);
}
