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

  const solid = () => {
    const seen = (place) => Grainspan.turned(place, turn);
    const grains = cell.grains.map(([x, y, z, r, rattler]) => ({ place: seen([x, y, z]), r, rattler }));
    grains.sort((a, b) => a.place[2] - b.place[2]);
    const lines = cell.contacts.map(([x, y, z, dx, dy, dz, compression, , sliding]) => ({ from: seen([x, y, z]), to: seen([x + dx, y + dy, z + dz]), compression, sliding }));
    return { grains, lines };
  };

  const draw = () => {
    element("cell-title").textContent = chosen === null ? "" : `of Gauss point ${chosen}`;
    if (!cell) {
      canvas.style.height = "0";
      element("cell-note").textContent = note || (Grainspan.state?.live || Grainspan.state?.cells.length ? "Click a Gauss point of the body." : "No grains were kept: no step was accepted, or the scene switches them off.");
      return;
    }
    const { grains, lines } = isSolid() ? solid() : plane();
    const outline = !isSolid() && cell.vectors.length === 2 ? [[0, 0], cell.vectors[0], cell.vectors[0].map((value, axis) => value + cell.vectors[1][axis]), cell.vectors[1]] : [];
    // The picture ends at the cell.
    const xs = outline.length ? outline.map((place) => place[0]) : grains.flatMap(({ place, r }) => [place[0] - r, place[0] + r]);
    const ys = outline.length ? outline.map((place) => place[1]) : grains.flatMap(({ place, r }) => [place[1] - r, place[1] + r]);
    const [left, right] = Grainspan.extent(xs) ?? [0, 1], [bottom, top] = Grainspan.extent(ys) ?? [0, 1];
    const width = canvas.clientWidth || 300;
    const height = Math.round(Math.min(Math.max(width * ((top - bottom) / (right - left)), 140), 430));
    const { context } = Grainspan.prepare(canvas, height);
    const zoom = Math.min((width - 8) / (right - left), (height - 8) / (top - bottom));
    const onScreen = ([x, y]) => [width / 2 + zoom * (x - (left + right) / 2), height / 2 - zoom * (y - (bottom + top) / 2)];
    const around = () => {
      context.beginPath();
      outline.forEach((place, i) => context[i ? "lineTo" : "moveTo"](...onScreen(place)));
      context.closePath();
    };
    context.save();
    if (outline.length) { around(); context.clip(); }
    for (const { place, r, rattler } of grains) {
      context.beginPath();
      context.arc(...onScreen(place), zoom * r, 0, 2 * Math.PI);
      context.fillStyle = rattler ? "#ffffff" : isSolid() ? "rgba(240,232,208,.55)" : "#f0e8d0";
      context.fill();
      context.lineWidth = 0.6;
      context.strokeStyle = rattler ? "#bbbbbb" : "#b9ad8c";
      context.stroke();
    }
    const largest = Math.max(...lines.map((one) => Math.abs(one.compression)), 1e-300);
    const thick = Math.min(Math.max(zoom * (grains[0]?.r ?? 1) * 0.9, 3), 14);
    context.lineCap = "round";
    for (const { from, to, compression, sliding } of lines) {
      context.beginPath();
      context.moveTo(...onScreen(from));
      context.lineTo(...onScreen(to));
      context.lineWidth = Math.max((thick * Math.abs(compression)) / largest, 0.3);
      context.strokeStyle = compression < 0 ? "#1a7f37" : sliding ? "#c2410c" : "#20407a";
      context.stroke();
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
    follow() { if (chosen !== null) load(); },
    redraw: draw,
  };
  element("point").addEventListener("change", (event) => Grainspan.cell.choose(Number(event.target.value)));
  Grainspan.turnable(canvas, turn, isSolid, draw);
}
