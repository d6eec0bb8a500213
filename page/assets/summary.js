"use strict";
// Words and tables: how the run stands, where time goes, workers, counters, figures.
{
  const { element, make, number, seconds, words } = Grainspan;

  const KIND = { done: "good", running: "live", paused: "live" };

  // What may have cost accuracy: counters, then warnings that are more than a count.
  const serious = (state) => [...(state.counters ?? []).filter((one) => !one.harmless).map((one) => one.text), ...(state.warnings ?? [])];

  const head = (state) => {
    const status = element("status");
    status.textContent = words(state.status);
    status.className = KIND[state.status] ?? "bad";
    const reason = element("reason");
    reason.hidden = !state.reason || Boolean(state.live);
    reason.textContent = state.reason ?? "";
    const live = state.live;
    element("progress").hidden = !live;
    element("controls").hidden = !live || !Grainspan.isLive;
    const texts = [];
    if (live) {
      element("progress-bar").style.width = `${100 * live.load}%`;
      const elapsed = Date.now() / 1000 - live.begun;
      texts.push(`step ${live.step}, ${number(100 * live.load, 3)} % of the load`, `${number(live.evaluations)} evaluations`, `for ${seconds(elapsed)}`);
    } else if (state.figures.steps !== undefined) {
      texts.push(`${state.figures.steps} ${state.figures.steps === 1 ? "step" : "steps"}`, `${number(state.figures.gauss_points)} Gauss points`, `${number(state.figures.rve_evaluations)} evaluations`);
      if (state.figures.time) texts.push(seconds(state.figures.time.wall_s));
    }
    element("progress-text").textContent = texts.join(" \u00b7 ");
    for (const button of element("controls").querySelectorAll("button")) {
      const action = button.dataset.action, paused = state.status === "paused" || state.requests.includes("pause");
      button.disabled = action === "pause" ? paused : action === "resume" ? !paused : state.requests.includes(action);
    }
    const pending = state.requests.filter((name) => !(name === "pause" && state.status === "paused"));
    const notes = pending.length ? [`${pending.join(", ")} requested: acts after the current step`] : [];
    if (state.not_saved) notes.push(`the state could not be saved: ${state.not_saved}`);
    element("control-note").textContent = notes.join(" \u00b7 ");
    const concerns = serious(state);
    const accuracy = element("accuracy");
    const errors = [[state.figures.accuracy?.estimated_error_of_mean, "by the strain per step"], [state.figures.balance?.error_of_mean, "by the balance of forces"]];
    const known = errors.filter(([error]) => error !== undefined && error !== null).map(([error, cause]) => `${number(100 * error, 2)} % of the pressure ${cause}`);
    const about = known.length ? ` Estimated error of the mean stress: ${known.join(", ")}.` : "";
    accuracy.className = concerns.length ? "bad" : "";
    accuracy.textContent = state.counters === null ? "" : concerns.length ? `Accuracy: ${concerns.join("; ")}.${about}` : `Accuracy: no warnings.${about}`;
  };

  const NAMES = { rve_s: "grains to equilibrium", tangent_s: "tangents", transport_s: "messages", assembly_s: "assembly", linear_solver_s: "linear solver", idle_s: "workers waiting" };

  const time = (state) => {
    const times = state.figures.time ?? state.live?.time ?? null;
    const holder = element("time");
    if (!times) {
      holder.replaceChildren(make("p", state.live ? "Known after the first step." : "Not known: the run has left no summary.", { class: "note" }));
      return;
    }
    const rows = Object.entries(NAMES).filter(([key]) => times[key] !== undefined).map(([key, name]) => [name, times[key]]);
    const largest = Math.max(...rows.map(([, value]) => value), 1e-30);
    const sum = rows.reduce((total, [, value]) => total + value, 0) || 1;
    holder.replaceChildren(...rows.map(([name, value]) => {
      const row = make("div", null, { class: "bar-row" }), track = make("div"), bar = make("div", null, { class: "bar" });
      bar.style.width = `${(100 * value) / largest}%`;
      track.append(bar);
      row.append(make("span", name), track, make("span", `${seconds(value)}`, { class: "amount", title: `${number((100 * value) / sum, 3)} %` }));
      return row;
    }), make("p", `Sums over the workers, except assembly and linear solver.${times.wall_s ? ` Elapsed: ${seconds(times.wall_s)}.` : ""}`, { class: "note" }));
  };

  const table = (header, rows) => {
    const made = make("table"), line = (cells, tag) => {
      const row = make("tr");
      cells.forEach((cell, index) => row.append(make(tag, cell, index ? { class: "number" } : {})));
      return row;
    };
    if (header) made.append(line(header, "th"));
    made.append(...rows.map((row) => line(row, "td")));
    return made;
  };

  const workers = (state) => {
    const list = state.live?.workers ?? [];
    const holder = element("workers");
    element("workers-section").hidden = !state.live;
    if (!list.length) {
      holder.replaceChildren(make("p", "None has joined yet.", { class: "note" }));
      return;
    }
    const most = 32;
    const rows = list.slice(0, most).map((one) => [`${one.pid}`, String(one.jobs), seconds(one.busy_s), one.point === null || one.point === undefined ? "waits" : `${one.point} for ${seconds(one.since_s)}`]);
    holder.replaceChildren(table(["process", "jobs", "busy", "at Gauss point"], rows));
    if (list.length > most) holder.append(make("p", `and ${list.length - most} more`, { class: "note" }));
  };

  const counters = (state) => {
    const holder = element("counters");
    holder.replaceChildren();
    if (!state.counters) {
      holder.append(make("p", "Not known: the run has left no summary. Warnings of the log are below.", { class: "note" }));
      return;
    }
    const list = (of, kind) => {
      const made = make("ul", null, { class: `counters ${kind}` });
      made.append(...of.map((text) => make("li", text)));
      return made;
    };
    const concerns = serious(state), harmless = state.counters.filter((one) => one.harmless).map((one) => one.text);
    holder.append(make("p", concerns.length ? "Look at this: the result may be less accurate than requested." : "Nothing that concerns the accuracy.", concerns.length ? {} : { class: "note" }));
    if (concerns.length) holder.append(list(concerns, "bad"));
    if (harmless.length) holder.append(make("p", "Harmless: the accepted states meet the same tolerances.", { class: "note" }), list(harmless, ""));
  };

  const facts = (state) => {
    const plain = Object.entries(state.figures).filter(([, value]) => typeof value === "number");
    const groups = ["accuracy", "energy"].filter((key) => state.figures[key]);
    const rows = (entries) => entries.filter(([, value]) => value !== null && typeof value !== "object").map(([key, value]) => [words(key), typeof value === "number" ? number(value) : String(value)]);
    const tables = [table(null, rows(plain))];
    for (const key of groups) {
      const unit = key === "energy" ? "energy, J (in the plane per metre)" : "accuracy, of the pressure";
      tables.push(table([unit, ""], rows(Object.entries(state.figures[key]))));
    }
    if (state.versions) tables.push(table(["versions", ""], rows(Object.entries(state.versions))));
    element("facts").replaceChildren(...tables);
    element("facts-section").hidden = !plain.length && !state.versions;
  };

  const warnings = (log) => {
    const details = element("warnings"), count = log.warnings.length + log.more_warnings;
    details.querySelector("summary").textContent = count ? `${count} warnings of the log` : "No warnings in the log";
    details.querySelector("pre").textContent = log.warnings.join("\n") + (log.more_warnings ? `\nand ${log.more_warnings} more in run.jsonl` : "");
  };

  const files = () => {
    const holder = element("files");
    if (!Grainspan.isLive || holder.childElementCount) return;
    holder.append("Files: ");
    for (const name of ["history.csv", "units.json", "summary.json", "run.jsonl", "scene.toml"]) holder.append(make("a", name, { href: `files/${name}` }), " ");
  };

  Grainspan.summary = {
    state(state) {
      head(state); time(state); workers(state); counters(state); facts(state); files();
      element("scene").textContent = state.scene ?? "";
    },
    warnings,
  };
}
