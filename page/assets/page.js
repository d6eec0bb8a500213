"use strict";
// Loads everything once, and again whatever has changed while a run goes on.
{
  const { element, get, post } = Grainspan;
  let isBusy = false;
  // What has been drawn in full: after an error everything that is new counts as new again.
  let drawn = {};

  const update = async () => {
    if (isBusy) return;
    isBusy = true;
    try {
      const state = await get("state");
      const isNew = state.version !== drawn.version, isLive = Boolean(state.live);
      Grainspan.state = state;
      Grainspan.summary.state(state);
      if (isNew) {
        if (state.run !== drawn.run) {
          await Grainspan.mesh.load();
          Grainspan.cell.clear();
        }
        const [history, log] = await Promise.all([get("history"), get("log")]);
        Grainspan.curves.show(history);
        Grainspan.curves.log(log);
        Grainspan.summary.warnings(log);
      }
      if (isNew || isLive !== drawn.isLive) {
        await Grainspan.mesh.update(state);
        await Grainspan.cell.update(state);
      }
      drawn = { version: state.version, run: state.run, isLive };
      element("control-note").classList.remove("bad");
    } catch (error) {
      if (!Grainspan.isLive) document.body.dataset.error = String(error);
      element("progress-text").textContent = Grainspan.isLive ? `No answer from the server (${error.message}); trying again.` : String(error);
    } finally {
      isBusy = false;
    }
    document.body.dataset.ready = "yes";
  };

  for (const button of element("controls").querySelectorAll("button")) {
    button.addEventListener("click", async () => {
      const action = button.dataset.action;
      const later = Grainspan.state?.keeps_checkpoints === false ? "It keeps no checkpoints and cannot be continued." : "It can be continued with --resume.";
      if (action === "stop" && !confirm(`End the run after its current step? ${later}`)) return;
      const problem = await post("control", { action }).catch((error) => String(error));
      await update();
      if (problem) element("control-note").textContent = problem;
    });
  }

  let waiting = null;
  let width = document.body.clientWidth;
  new ResizeObserver(() => {
    if (document.body.clientWidth === width) return;
    width = document.body.clientWidth;
    clearTimeout(waiting);
    waiting = setTimeout(() => { Grainspan.curves.redraw(); Grainspan.mesh.redraw(); Grainspan.cell.redraw(); }, 100);
  }).observe(document.body);

  update();
  if (Grainspan.isLive) setInterval(update, 1500);
}
