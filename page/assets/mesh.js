"use strict";
// The deformed mesh coloured by a field, with its Gauss points.
{
  const { element, make, number, scaled, extent, words, withUnit } = Grainspan;
  const canvas = element("mesh");
  const turn = { yaw: 0.6, pitch: 0.35, moved: 0 };
  const frames = new Map();
  // Counts the runs that have been shown: an answer about an earlier one comes too late.
  let run = 0;
  // The field that was chosen by hand: a frame that lacks it does not take it from the next.
  let wished = null;
  let mesh = null, steps = [], follows = true, current = null, range = null, places = [], cells = new Set(), chosen = null;

  const isSolid = () => mesh?.dimension === 3;

  const node = (index, scale) => [0, 1, 2].map((axis) => mesh.nodes[3 * index + axis] + scale * (current?.displacement[3 * index + axis] ?? 0));

  // Of each outline of a solid, whether its nodes go around as seen from outside (1) or from inside (-1).
  let facing = [];
  const faces = () => {
    const middles = new Map();
    for (const [of, weights] of mesh.points) {
      const sum = middles.get(of) ?? [0, 0, 0, 0];
      for (const [index, weight] of weights) for (const axis of [0, 1, 2]) sum[axis] += weight * mesh.nodes[3 * index + axis];
      sum[3] += 1;
      middles.set(of, sum);
    }
    return mesh.outlines.map((outline, number) => {
      const places = outline.map((index) => [0, 1, 2].map((axis) => mesh.nodes[3 * index + axis]));
      const middle = middles.get(mesh.of[number]);
      const out = [0, 1, 2].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length - middle[axis] / middle[3]);
      const normal = [0, 0, 0];
      places.forEach((a, i) => {
        const b = places[(i + 1) % places.length];
        for (const axis of [0, 1, 2]) normal[axis] += a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3];
      });
      return normal[0] * out[0] + normal[1] * out[1] + normal[2] * out[2] < 0 ? -1 : 1;
    });
  };

  // Whether the viewer is in front of a face; its neighbours hide it otherwise.
  const isInFront = (number, seen) => {
    const places = mesh.outlines[number].map((index) => seen[index]);
    const area = places.reduce((sum, a, i) => { const b = places[(i + 1) % places.length]; return sum + a[0] * b[1] - b[0] * a[1]; }, 0);
    return facing[number] * area > 0;
  };

  // The largest displacement drawn at an eighth of the body.
  const automatic = () => {
    const size = Math.max(...[0, 1, 2].map((axis) => { const found = extent(mesh.nodes.filter((_, i) => i % 3 === axis)); return found[1] - found[0]; }));
    const largest = Grainspan.largest(current?.displacement ?? []);
    if (!(largest > 0)) return 1;
    const wanted = (0.125 * size) / largest;
    if (wanted <= 1) return 1;
    const power = 10 ** Math.floor(Math.log10(wanted));
    return power * (wanted / power >= 5 ? 5 : wanted / power >= 2 ? 2 : 1);
  };

  const magnification = () => {
    const select = element("magnify");
    const auto = automatic();
    const before = select.value || "1";
    select.replaceChildren(...[["1", "true to scale"], ["auto", `\u00d7 ${auto}`], ["0", "none"]].map(([value, text]) => make("option", text, { value })));
    select.value = before;
    return before === "auto" ? auto : Number(before);
  };

  const draw = () => {
    if (!mesh || mesh.problem) {
      element("mesh-note").textContent = mesh?.problem ?? "";
      canvas.style.height = "0";
      return;
    }
    const scale = magnification();
    const count = mesh.nodes.length / 3;
    const all = Array.from({ length: count }, (_, index) => node(index, scale));
    const seen = isSolid() ? all.map((place) => Grainspan.turned(place, turn)) : all;
    const [left, right] = extent(seen.map((place) => place[0])), [bottom, top] = extent(seen.map((place) => place[1]));
    const room = 12;
    const width = canvas.clientWidth || 300;
    const across = Math.max(right - left, 1e-30), up = Math.max(top - bottom, 1e-30);
    const height = Math.round(Math.min(Math.max((width - 2 * room) * (up / across) + 2 * room, 140), 430));
    const { context } = Grainspan.prepare(canvas, height);
    const zoom = Math.min((width - 2 * room) / across, (height - 2 * room) / up);
    const [x0, y0] = [(width - zoom * across) / 2, (height - zoom * up) / 2];
    const onScreen = (place) => [x0 + zoom * (place[0] - left), height - y0 - zoom * (place[1] - bottom)];

    const name = element("field").value;
    const values = current?.values[name] ?? null;
    const own = values ? extent(values) : null;
    if (!element("fixed-range").checked || !range || range.name !== name) range = own ? { name, low: own[0], high: own[1] } : null;
    const share = (value) => (range.high > range.low ? (value - range.low) / (range.high - range.low) : 0.5);
    let order = mesh.outlines.map((_, index) => index);
    if (isSolid()) {
      const depth = mesh.outlines.map((outline) => outline.reduce((sum, index) => sum + seen[index][2], 0) / outline.length);
      order = order.filter((index) => isInFront(index, seen)).sort((a, b) => depth[a] - depth[b]);
    }
    context.lineWidth = mesh.outlines.length > 3000 ? 0.25 : 0.7;
    context.strokeStyle = "rgba(30,30,30,.6)";
    for (const index of order) {
      context.beginPath();
      mesh.outlines[index].forEach((place, i) => context[i ? "lineTo" : "moveTo"](...onScreen(seen[place])));
      context.closePath();
      const value = values?.[mesh.of[index]];
      context.fillStyle = values && range ? (value === null ? "#bbbbbb" : Grainspan.colour(share(value))) : "#f2efe6";
      context.fill();
      context.stroke();
    }
    drawPoints(context, all, onScreen, values);
    if (isSolid()) Grainspan.drawAxes(context, turn, height);
    bar(name);
    note();
  };

  const drawPoints = (context, all, onScreen, values) => {
    const few = mesh.points.length <= (isSolid() ? 400 : 4000);
    places = mesh.points.map(([, weights]) => {
      const place = [0, 1, 2].map((axis) => weights.reduce((sum, [index, weight]) => sum + weight * all[index][axis], 0));
      return onScreen(isSolid() ? Grainspan.turned(place, turn) : place);
    });
    places.forEach(([x, y], index) => {
      const isChosen = index === chosen, has = cells.has(index);
      if (!isChosen && !few) return;
      context.beginPath();
      context.arc(x, y, isChosen ? 5.5 : has ? 2.6 : 1.6, 0, 2 * Math.PI);
      context.fillStyle = isChosen ? "#d1242f" : has ? "#ffffff" : values ? "rgba(255,255,255,.55)" : "#8c959f";
      context.fill();
      context.lineWidth = isChosen ? 2 : 0.8;
      context.strokeStyle = isChosen ? "#ffffff" : "#1f2328";
      if (isChosen || has) context.stroke();
    });
  };

  const bar = (name) => {
    const holder = element("colour-bar");
    holder.replaceChildren();
    if (!range) return;
    const unit = current.fields.find((one) => one.name === name)?.unit;
    const scale = scaled(unit, Math.max(Math.abs(range.low), Math.abs(range.high)));
    const strip = make("div", null, { class: "strip" });
    strip.style.background = Grainspan.gradient;
    const ticks = make("div", null, { class: "ticks" });
    const size = Math.max(Math.abs(range.low), Math.abs(range.high)), spread = (range.high - range.low) / size;
    // As many digits as tell the ticks apart.
    const digits = spread > 0 ? Math.min(Math.max(Math.ceil(Math.log10(4 / spread)) + 1, 3), 8) : 3;
    for (const part of [0, 0.25, 0.5, 0.75, 1]) ticks.append(make("span", number((range.low + part * (range.high - range.low)) * scale.factor, digits)));
    holder.append(strip, ticks, make("div", words(name) + (scale.unit ? `, ${scale.unit}` : ", \u2013"), { class: "name" }));
    if (spread < 0.02) holder.append(make("div", `All values lie within ${number(100 * spread, 2)} %.`, { class: "note" }));
  };

  const note = () => {
    const sides = [0, 1, 2].map((axis) => extent(mesh.nodes.filter((_, i) => i % 3 === axis))).map(([low, high]) => high - low).slice(0, mesh.dimension);
    const length = scaled("m", Math.max(...sides));
    const parts = [`${sides.map((side) => number(side * length.factor)).join(" \u00d7 ")} ${length.unit}, ${mesh.points.length} Gauss points${Grainspan.state?.live || cells.size ? "; click one to see its grains" : ""}.`];
    if (isSolid()) parts.push("Drag to turn.");
    if (!current) parts.unshift("No fields were written: the mesh as given.");
    const cellsLeft = Grainspan.state?.cells_left_out;
    if (cellsLeft) parts.push(`Grains of ${cellsLeft} more points are left out of this file.`);
    const left = Grainspan.state?.frames_left_out;
    if (left) parts.push(`${left} steps with fields are left out of this file.`);
    element("mesh-note").textContent = parts.join(" ");
  };

  const load = async (index) => {
    const step = steps[index]?.step;
    if (step === undefined) { current = null; draw(); return; }
    const field = element("field").value, of = run;
    const key = `${step} ${Grainspan.isLive ? field : ""}`;
    if (!frames.has(key)) {
      const query = { step };
      // Without a field the names of all come with the first answer.
      if (field) query.field = field;
      const found = await Grainspan.get("frame", query);
      if (!found || of !== run) return;
      if (frames.size > 60) frames.clear();
      frames.set(key, found);
    }
    if (Number(element("step").value) !== index) return;
    current = frames.get(key);
    const names = current.fields.map((one) => [one.name, words(one.name)]);
    const preferred = ["shear_strain", "q", "void_ratio"].find((name) => names.some(([known]) => known === name));
    const shown = Grainspan.fill(element("field"), names, preferred, wished);
    // A server sends the values of the field that was asked for; the first answer has them all.
    if (current.values[shown] === undefined && shown !== field) { await load(index); return; }
    element("step-text").textContent = `${current.step}, time ${number(current.time)} s`;
    draw();
    Grainspan.cell.follow(step);
  };

  const pick = (event) => {
    if (!mesh || mesh.problem || turn.moved > 4) { turn.moved = 0; return; }
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    let best = null;
    places.forEach(([px, py], index) => {
      const distance = Math.hypot(px - x, py - y);
      if (!best || distance < best.distance) best = { distance, index };
    });
    if (best && best.distance < 60) Grainspan.cell.choose(best.index);
  };

  Grainspan.mesh = {
    async load() {
      mesh = await Grainspan.get("mesh");
      // What is known of the run before does not belong to this one.
      run += 1;
      frames.clear();
      steps = [];
      current = range = null;
      facing = isSolid() && !mesh.problem ? faces() : [];
      draw();
    },
    count: () => mesh?.points?.length ?? 0,
    // Steps that have fields and Gauss points that have cells.
    async update(state) {
      steps = state.frames;
      cells = new Set(state.cells.map((one) => one.point));
      const slider = element("step");
      element("step-tools").hidden = steps.length < 1;
      slider.max = Math.max(steps.length - 1, 0);
      if (follows) slider.value = slider.max;
      await load(Number(slider.value));
    },
    mark(point) { chosen = point; draw(); },
    place: (point) => mesh?.points?.[point]?.[0],
    value(point) {
      const name = element("field").value, of = mesh?.points?.[point]?.[0], value = current?.values[name]?.[of];
      return value === null || value === undefined ? "" : `${words(name)} of its element ${withUnit(value, current.fields.find((one) => one.name === name)?.unit)}`;
    },
    step: () => current?.step ?? steps[steps.length - 1]?.step ?? 0,
    redraw: draw,
  };
  element("step").addEventListener("input", (event) => {
    follows = event.target.value === event.target.max;
    load(Number(event.target.value));
  });
  element("field").addEventListener("change", (event) => {
    wished = event.target.value;
    load(Number(element("step").value));
  });
  for (const id of ["magnify", "fixed-range"]) element(id).addEventListener("change", draw);
  Grainspan.turnable(canvas, turn, isSolid, draw);
  canvas.addEventListener("click", pick);
}
