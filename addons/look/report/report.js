// What ties the plots of a report together: one cursor for all, and the switches.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  let doc, ticks, cursor, axis = "distance_m", shown = -1;

  const all = (name) => Array.from(doc._all_models.values()).filter((model) => model.name === name);
  const one = (name) => all(name)[0];

  function start() {
    doc = Bokeh.documents[0];
    ticks = one("ticks").data;
    cursor = one("cursor_source");
    fit();
    window.addEventListener("resize", fit);
    for (const plot of all("over_time")) {
      plot.on_event("mousemove", (event) => show(nearestAlong(event.x)));
      plot.on_event("tap", (event) => seek(nearestAlong(event.x)));
    }
    one("map").on_event("mousemove", (event) => show(nearest("x_m", "y_m", event.x, event.y)));
    one("gg").on_event("mousemove", (event) => show(nearest("acceleration_left_m_s2", "acceleration_ahead_m_s2", event.x, event.y)));
    page.wire("colour", colourBy);
    page.wire("across", setAxis);
    const video = document.querySelector("video");
    if (video) video.addEventListener("timeupdate", () => { if (!video.paused) show(atTime(data.clip_start + video.currentTime)); });
    for (const row of document.querySelectorAll("tr.here")) {
      row.addEventListener("click", () => {
        const tick = atTime(Number(row.dataset.time));
        show(tick); seek(tick);
        document.getElementById("map").scrollIntoView({ behavior: "smooth", block: "nearest" });
      });
    }
  }

  // on a narrow page legends have two columns of short names, and the g-g diagram is as wide as the page
  const wide = { side: 0, names: new Map() };
  function fit() {
    const room = document.body.clientWidth, narrow = room < 600, gg = one("gg");
    wide.side = wide.side || gg.frame_width;
    const side = Math.max(160, Math.min(wide.side, room - 28 - 80));
    if (gg.frame_width !== side) gg.setv({ frame_width: side, frame_height: side });
    for (const legend of all("legend")) {
      for (const item of legend.items) {
        if (!wide.names.has(item)) wide.names.set(item, item.label);
        const name = wide.names.get(item);
        item.label = narrow && name.value ? { ...name, value: name.value.split(",")[0] } : name;
      }
      legend.setv({ ncols: narrow ? 2 : "auto", spacing: narrow ? 4 : 12 });
    }
  }

  // first index in an ascending array whose value is not below the wanted one, or the one before if that is nearer
  function bisect(values, wanted) {
    let low = 0, high = values.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (values[middle] < wanted) low = middle + 1; else high = middle;
    }
    return low > 0 && wanted - values[low - 1] < values[low] - wanted ? low - 1 : low;
  }
  const nearestAlong = (place) => bisect(ticks[axis], place);
  const atTime = (time) => bisect(ticks.time_s, time);
  function nearest(xName, yName, x, y) {
    const xs = ticks[xName], ys = ticks[yName];
    let best = -1, least = Infinity;
    for (let i = 0; i < xs.length; i++) {
      const away = (xs[i] - x) ** 2 + (ys[i] - y) ** 2;
      if (away < least) { least = away; best = i; }
    }
    return best;
  }

  function show(tick) {
    if (tick === shown || tick < 0 || !(tick < ticks.time_s.length)) return;
    shown = tick;
    const values = {};
    for (const name of Object.keys(cursor.data)) values[name] = [ticks[name][tick]];
    cursor.data = values;
    for (const line of all("cursor")) line.setv({ location: ticks[axis][tick], visible: true });
    const box = document.getElementById("readout");
    box.dataset.tick = tick;
    box.replaceChildren();
    for (const [label, column, digits, unit] of data.readout) {
      const part = document.createElement("div"), name = document.createElement("span");
      name.textContent = label + " ";
      const value = Number(ticks[column][tick]);
      part.append(name, value >= data.free && column === "limit_speed_m_s" ? "none" : value.toFixed(digits) + (unit ? " " + unit : ""));
      box.append(part);
    }
  }

  function seek(tick) {
    const video = document.querySelector("video");
    if (!video || tick < 0) return;
    const time = ticks.time_s[tick] - data.clip_start;
    if (time >= 0 && time <= video.duration) video.currentTime = time;
  }

  function colourBy(name) {
    const [title, high] = data.colours[name];
    const mapper = one("mapper"), line = one("line"), marks = one("slides");
    mapper.setv({ low: 0, high: high });
    line.glyph.line_color = { field: name, transform: mapper };
    one("scale").title = title;
    if (marks) marks.visible = name === "slide_m_s";
    document.getElementById("map").dataset.colour = name;
  }

  function setAxis(name) {
    axis = name;
    for (const line of all("across").filter((model) => model.glyph)) line.glyph.x = { field: name };
    for (const mark of all("lap_end")) mark.location = mark.tags[name === "time_s" ? 1 : 0];
    const end = Math.max(ticks[name][ticks[name].length - 1] || 0, 1e-3);
    const range = all("across").find((model) => !model.glyph);
    range.setv({ bounds: null });
    range.setv({ start: 0, end: end, reset_start: 0, reset_end: end });
    range.setv({ bounds: [0, end] });
    one("axis_across").axis_label = data.axes[name];
    const tick = shown; shown = -1; show(tick);
  }

  document.addEventListener("plots", start);
})();
