// What scripts of pages share. Bokeh's plots get the colours of the page; when they are there, the event "plots" says so.
"use strict";
const page = (function () {
  // colours of the style sheet by their names
  const colours = (...names) => {
    const style = getComputedStyle(document.documentElement);
    return names.map((name) => style.getPropertyValue(`--${name}`).trim());
  };

  // calls `act` with the value of a button of a switch that is pressed
  function wire(name, act) {
    const buttons = Array.from(document.querySelectorAll(`[data-switch="${name}"]`));
    for (const button of buttons) {
      button.addEventListener("click", () => {
        for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
        act(button.value);
      });
    }
  }

  // calls `act` now and whenever the screen turns light or dark
  function painted(act) {
    act();
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", act);
  }

  function paint() {
    const [ink, soft, line] = colours("ink", "soft", "line");
    for (const model of Bokeh.documents[0]._all_models.values()) {
      const own = {};
      for (const [part, colour] of [["axis_label_text_color", ink], ["major_label_text_color", soft], ["axis_line_color", soft],
        ["major_tick_line_color", soft], ["grid_line_color", line], ["label_text_color", ink], ["title_text_color", ink]]) {
        if (part in model.attributes) own[part] = colour;
      }
      if (Object.keys(own).length) model.setv(own);
    }
  }

  function start() {
    if (!(Bokeh.documents.length && Bokeh.documents[0]._all_models)) return window.setTimeout(start, 30);
    painted(paint);
    document.dispatchEvent(new Event("plots"));
    document.documentElement.dataset.ready = "yes";
  }
  window.addEventListener("load", () => { if (window.Bokeh) start(); });

  return { colours, wire, painted };
})();
