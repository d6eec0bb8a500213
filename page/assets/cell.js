"use strict";
// The grains of one Gauss point with their force chains.
{
  const { element, number, withUnit } = Grainspan;
  const canvas = element("cell");
  const turn = { yaw: 0.6, pitch: 0.35, moved: 0 };
  let chosen = null, cell = null, note = "", asked = -1;

  const isSolid = () => cell?.dimension === 3;

  // Whole cells by which a place lies outside; nothing without periodicity vectors.
  const outside = (place) => {
    const [a, b] = cell.vectors;
    const area = a[0] * b[1] - a[1] * b[0];
    return [Math.floor((place[0] * b[1] - place[1] * b[0]) / area), Math.floor((a[0] * place[1] - a[1] * place[0]) / area)];
  };
  const moved = (place, by) => place.map((value, axis) => value - by[0] * cell.vectors[0][axis] - by[1] * cell.vectors[1][axis]);

  // Whether a disc reaches into the cell.
  const touches = (place, r) => {
    const [a, b] = cell.vectors;
    const area = a[0] * b[1] - a[1] * b[0];
    const along = (place[0] * b[1] - place[1] * b[0]) / area, across = (a[0] * place[1] - a[1] * place[0]) / area;
    const [s, t] = [(r * Math.hypot(...b)) / Math.abs(area), (r * Math.hypot(...a)) / Math.abs(area)];
    return along > -s && along < 1 + s && across > -t && across < 1 + t;
  };

  // Grains and contacts of a plane cell, inside its outline; a contact across the border is drawn at both sides.
  const plane = () => {
    const wraps = cell.vectors.length === 2;
    const grains = [];
    for (const [x, y, r, rattler] of cell.grains) {
      if (!wraps) { grains.push({ place: [x, y], r, rattler }); continue; }
      const home = outside([x, y]);
      // A grain across the border is drawn at each side that it reaches.
      for (const shift of [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]]) {
        const place = moved([x, y], [home[0] + shift[0], home[1] + shift[1]]);
        if (!shift[0] && !shift[1] || touches(place, r)) grains.push({ place, r, rattler });
      }
    }
    const lines = [];
    for (const [x, y, dx, dy, compression, tangential, sliding] of cell.contacts) {
      const add = (shift, from, to) => lines.push({ from: shift ? moved(from, shift) : from, to: shift ? moved(to, shift) : to, compression, sliding });
      const [from, to] = [[x, y], [x + dx, y + dy]];
      if (!wraps) { add(null, from, to); continue; }
      const [first, second] = [outside(from), outside(to)];
      add(first, from, to);
      if (first[0] !== second[0] || first[1] !== second[1]) add(second, from, to);
    }
    return { grains, lines };
  };

  // Components along the periodicity vectors, so that 0 to 1 is inside the cell.
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const shares = (place) => {
    const [a, b, c] = cell.vectors;
    const volume = dot(a, cross(b, c));
    return [dot(place, cross(b, c)) / volume, dot(place, cross(c, a)) / volume, dot(place, cross(a, b)) / volume];
  };
  const atShares = (parts) => [0, 1, 2].map((axis) => parts.reduce((sum, part, index) => sum + part * cell.vectors[index][axis], 0));

  // What of a line, given by the shares of its ends, is inside the cell; null if nothing.
  const inside = (from, to) => {
    let [first, last] = [0, 1];
    for (const axis of [0, 1, 2]) {
      const along = to[axis] - from[axis];
      if (Math.abs(along) < 1e-12) { if (from[axis] < 0 || from[axis] > 1) return null; continue; }
      const [one, other] = [-from[axis] / along, (1 - from[axis]) / along];
      first = Math.max(first, Math.min(one, other));
      last = Math.min(last, Math.max(one, other));
    }
    const at = (part) => from.map((share, axis) => share + part * (to[axis] - share));
    return last > first ? [at(first), at(last)] : null;
  };

  // Grains with their centres in the cell, and contacts cut off at its faces; a contact across a face is drawn at both sides.
  const solid = () => {
    const wraps = cell.vectors.length === 3;
    const seen = (place) => Grainspan.turned(place, turn);
    const home = (parts) => parts.map(Math.floor);
    const grains = cell.grains.map(([x, y, z, r, rattler]) => {
      const parts = wraps ? shares([x, y, z]) : null;
      return { place: seen(wraps ? atShares(parts.map((part) => part - Math.floor(part))) : [x, y, z]), r, rattler };
    });
    const lines = [];
    for (const [x, y, z, dx, dy, dz, compression, , sliding] of cell.contacts) {
      const [from, to] = [[x, y, z], [x + dx, y + dy, z + dz]];
      if (!wraps) { lines.push({ from: seen(from), to: seen(to), compression, sliding }); continue; }
      const ends = [shares(from), shares(to)];
      const homes = ends.map(home);
      const images = homes[0].every((number, axis) => number === homes[1][axis]) ? [homes[0]] : homes;
      for (const image of images) {
        const part = inside(...ends.map((end) => end.map((share, axis) => share - image[axis])));
        if (part) lines.push({ from: seen(atShares(part[0])), to: seen(atShares(part[1])), compression, sliding });
      }
    }
    return { grains, lines };
  };

  // The twelve edges of a cell in space as seen, and whether each is behind: one at the corner that is farthest away.
  const edges = () => {
    if (!isSolid() || cell.vectors.length !== 3) return [];
    const corners = [];
    for (let index = 0; index < 8; index++) corners.push(Grainspan.turned(atShares([0, 1, 2].map((axis) => (index >> axis) & 1)), turn));
    const farthest = corners.reduce((best, corner, index) => (corner[2] < corners[best][2] ? index : best), 0);
    const found = [];
    for (let index = 0; index < 8; index++) {
      for (const axis of [0, 1, 2]) {
        const other = index | (1 << axis);
        if (other !== index) found.push({ ends: [corners[index], corners[other]], behind: index === farthest || other === farthest });
      }
    }
    return found;
  };

  // A colour that fades to the paper with the distance; `near` is 1 in front and 0 behind.
  const faded = (rgb, near) => `rgb(${rgb.map((part) => Math.round(part + (1 - near) * 0.62 * (255 - part))).join(",")})`;

  // Grains as balls and contacts between them, the farthest first.
  const drawSolid = (context, grains, lines, onScreen, zoom, widthOf) => {
    const depths = grains.map(({ place }) => place[2]);
    const [back, front] = Grainspan.extent(depths) ?? [0, 1];
    const near = (depth) => Math.min(Math.max((depth - back) / Math.max(front - back, 1e-300), 0), 1);
    const shapes = [
      ...grains.map((grain) => ({ depth: grain.place[2], grain })),
      ...lines.map((line) => ({ depth: 0.5 * (line.from[2] + line.to[2]), line })),
    ].sort((one, other) => one.depth - other.depth);
    for (const { depth, grain, line } of shapes) {
      const closeness = near(depth);
      context.beginPath();
      if (line) {
        context.moveTo(...onScreen(line.from));
        context.lineTo(...onScreen(line.to));
        context.lineWidth = widthOf(line);
        context.strokeStyle = faded(line.compression < 0 ? [26, 127, 55] : line.sliding ? [194, 65, 12] : [32, 64, 122], closeness);
        context.stroke();
        continue;
      }
      // Balls are drawn at half their size, so that the forces between them are seen.
      const [x, y] = onScreen(grain.place), radius = 0.5 * zoom * grain.r;
      context.arc(x, y, radius, 0, 2 * Math.PI);
      const shade = context.createRadialGradient(x - 0.35 * radius, y - 0.35 * radius, 0.1 * radius, x, y, radius);
      const [light, dark] = grain.rattler ? [[255, 255, 255], [225, 228, 232]] : [[252, 247, 232], [205, 187, 140]];
      shade.addColorStop(0, faded(light, closeness));
      shade.addColorStop(1, faded(dark, closeness));
      context.fillStyle = shade;
      context.fill();
      context.lineWidth = 0.5;
      context.strokeStyle = faded(grain.rattler ? [150, 156, 163] : [143, 128, 88], closeness);
      context.stroke();
    }
  };

  const draw = () => {
    element("cell-title").textContent = chosen === null ? "" : `of Gauss point ${chosen}`;
    if (!cell) {
      canvas.style.height = "0";
      element("cell-note").textContent = note || (Grainspan.state?.live || Grainspan.state?.cells.length ? "Click a Gauss point of the body." : "No grains were kept: no step was accepted, or the scene switches them off.");
      return;
    }
    const { grains, lines } = isSolid() ? solid() : plane();
    const box = edges();
    const outline = !isSolid() && cell.vectors.length === 2 ? [[0, 0], cell.vectors[0], cell.vectors[0].map((value, axis) => value + cell.vectors[1][axis]), cell.vectors[1]] : [];
    // The picture ends at the cell; in space, balls reach a little over its faces.
    const room = 8 + (box.length ? 10 : 0);
    const corners = outline.length ? outline : box.flatMap(({ ends }) => ends);
    const xs = corners.length ? corners.map((place) => place[0]) : grains.flatMap(({ place, r }) => [place[0] - r, place[0] + r]);
    const ys = corners.length ? corners.map((place) => place[1]) : grains.flatMap(({ place, r }) => [place[1] - r, place[1] + r]);
    const [left, right] = Grainspan.extent(xs) ?? [0, 1], [bottom, top] = Grainspan.extent(ys) ?? [0, 1];
    const width = canvas.clientWidth || 300;
    const height = Math.round(Math.min(Math.max(width * ((top - bottom) / (right - left)), 140), 430));
    const { context } = Grainspan.prepare(canvas, height);
    const zoom = Math.min((width - room) / (right - left), (height - room) / (top - bottom));
    const onScreen = ([x, y]) => [width / 2 + zoom * (x - (left + right) / 2), height / 2 - zoom * (y - (bottom + top) / 2)];
    const around = () => {
      context.beginPath();
      outline.forEach((place, i) => context[i ? "lineTo" : "moveTo"](...onScreen(place)));
      context.closePath();
    };
    context.save();
    if (outline.length) { around(); context.clip(); }
    const largest = Math.max(Grainspan.largest(lines.map((one) => one.compression)), 1e-300);
    const thick = Math.min(Math.max(zoom * (grains[0]?.r ?? 1) * (isSolid() ? 0.6 : 0.9), 3), isSolid() ? 9 : 14);
    const widthOf = (line) => Math.max((thick * Math.abs(line.compression)) / largest, 0.3);
    context.lineCap = "round";
    const drawEdges = (behind) => {
      context.lineWidth = 1;
      context.setLineDash(behind ? [3, 4] : [5, 4]);
      context.strokeStyle = behind ? "#b4bac1" : "#1f2328";
      for (const { ends } of box.filter((edge) => edge.behind === behind)) {
        context.beginPath();
        ends.forEach((place, i) => context[i ? "lineTo" : "moveTo"](...onScreen(place)));
        context.stroke();
      }
      context.setLineDash([]);
    };
    if (isSolid()) {
      drawEdges(true);
      drawSolid(context, grains, lines, onScreen, zoom, widthOf);
      drawEdges(false);
      Grainspan.drawAxes(context, turn, height);
    } else {
      for (const { place, r, rattler } of grains) {
        context.beginPath();
        context.arc(...onScreen(place), zoom * r, 0, 2 * Math.PI);
        context.fillStyle = rattler ? "#ffffff" : "#f0e8d0";
        context.fill();
        context.lineWidth = 0.6;
        context.strokeStyle = rattler ? "#bbbbbb" : "#b9ad8c";
        context.stroke();
      }
      for (const line of lines) {
        context.beginPath();
        context.moveTo(...onScreen(line.from));
        context.lineTo(...onScreen(line.to));
        context.lineWidth = widthOf(line);
        context.strokeStyle = line.compression < 0 ? "#1a7f37" : line.sliding ? "#c2410c" : "#20407a";
        context.stroke();
      }
    }
    context.restore();
    if (outline.length) {
      around();
      context.lineWidth = 1;
      context.setLineDash([5, 4]);
      context.strokeStyle = "#1f2328";
      context.stroke();
      context.setLineDash([]);
    }
    const count = cell.contacts.length, axes = cell.dimension;
    const mean = cell.contacts.reduce((sum, row) => sum + row[2 * axes], 0) / Math.max(count, 1);
    const sliding = cell.contacts.filter((row) => row[2 * axes + 2]).length / Math.max(count, 1);
    const rattlers = cell.grains.filter((row) => row[axes + 1]).length;
    element("cell-note").textContent = [
      `Step ${cell.step}: ${cell.grains.length} grains (${rattlers} rattlers), ${count} contacts.`,
      `Lines: compression, as wide as the force, mean ${withUnit(mean, "N")}, largest ${withUnit(largest, "N")}; ${number(100 * sliding, 2)} % slide (orange).`,
      isSolid() ? "Balls at half their size; drag to turn." : "",
      Grainspan.mesh.value(chosen), note,
    ].filter(Boolean).join(" ");
  };

  const load = async () => {
    if (chosen === null) { draw(); return; }
    const point = chosen;
    const found = await Grainspan.get("cell", { point, step: Grainspan.mesh.step() });
    if (point !== chosen) return;
    cell = found;
    const isRunning = Grainspan.state?.live;
    note = found || isRunning ? "" : "The grains of this point were not kept. Points with grains have a white dot; choose points for every step with output.grains in the scene.";
    if (!found && isRunning) note = "Requested: the run writes the grains of this point after its current step.";
    draw();
  };

  // Asks a live run for the grains of the chosen point, once a step.
  const ask = async () => {
    const live = Grainspan.state?.live;
    if (!Grainspan.isLive || !live || chosen === null || asked === `${chosen} ${live.step}`) return;
    asked = `${chosen} ${live.step}`;
    const problem = await Grainspan.post("cell", { point: chosen }).catch((error) => String(error));
    if (problem) { note = problem; draw(); }
  };

  Grainspan.cell = {
    async choose(point) {
      chosen = point;
      cell = null;
      note = "";
      element("point").value = String(point);
      Grainspan.mesh.mark(point);
      await load();
      await ask();
    },
    async update(state) {
      const known = state.cells.map((one) => one.point);
      const total = Grainspan.mesh.count();
      const all = state.live && total ? Array.from({ length: Math.min(total, 2000) }, (_, index) => index) : known;
      const listed = chosen !== null && !all.includes(chosen) ? [...all, chosen] : all;
      Grainspan.fill(element("point"), listed.map((point) => [point, `${point}${known.includes(point) ? "" : " (on request)"}`]), chosen ?? known[0]);
      if (chosen === null && known.length) { await Grainspan.cell.choose(known[0]); return; }
      await load();
      await ask();
    },
    // Forgets the grains of a run that another one has replaced.
    clear() {
      cell = null;
      note = "";
      asked = null;
      if (chosen !== null && chosen >= Grainspan.mesh.count()) { chosen = null; Grainspan.mesh.mark(null); }
    },
    follow() { if (chosen !== null) load(); },
    redraw: draw,
  };
  element("point").addEventListener("change", (event) => Grainspan.cell.choose(Number(event.target.value)));
  Grainspan.turnable(canvas, turn, isSolid, draw);
}
