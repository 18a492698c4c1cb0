"use strict";
// Draws each incident: the edges of the track, the cars every half second before the touch, and a car that can be played.
(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const space = "http://www.w3.org/2000/svg";
  const slow = 3.0;  // times slower than it was
  const jump = 0.5;  // [m] between two poses: a car was put back, and is not moved in between

  function make(name, attributes, parent) {
    const found = document.createElementNS(space, name);
    for (const [key, value] of Object.entries(attributes)) found.setAttribute(key, value);
    if (parent) parent.append(found);
    return found;
  }

  const shared = make("svg", {width: 0, height: 0, style: "position:absolute"}, document.body);
  data.tracks.forEach((edges, track) => {
    const path = edges.map(edge => {
      let text = "";
      for (let i = 0; i < edge.length; i += 2) text += `${i ? "L" : "M"}${edge[i] / 100} ${-edge[i + 1] / 100}`;
      return text + "Z";
    }).join("");
    make("path", {id: `track-${track}`, d: path, fill: "none", stroke: "#444", "stroke-width": 0.03}, shared);
  });

  function pose(clip, car, at) {
    const row = clip.poses[car], last = row.length / 3 - 1;
    const i = Math.min(Math.floor(at), last), j = Math.min(i + 1, last), share = at - i;
    const [x, y, h] = [0, 1, 2].map(k => row[3 * i + k] / 1000), [u, v, g] = [0, 1, 2].map(k => row[3 * j + k] / 1000);
    if (Math.hypot(u - x, v - y) > jump) return [x, y, h];
    const turn = Math.atan2(Math.sin(g - h), Math.cos(g - h));
    return [x + share * (u - x), y + share * (v - y), h + share * turn];
  }

  function car(clip, index, parent, faint) {
    const [length, width, overhang] = data.sizes[clip.cars[index]], colour = clip.colours[index];
    const group = make("g", {}, parent);
    make("rect", {x: -overhang, y: -width / 2, width: length, height: width, rx: 0.04, stroke: colour,
      fill: faint ? "none" : colour, "fill-opacity": 0.75, "stroke-width": 0.02}, group);
    if (!faint) make("path", {d: `M${length - overhang - 0.12} ${-width / 2 + 0.05}v${width - 0.1}`, stroke: "#fff",
      "stroke-width": 0.04}, group);
    return group;
  }

  function put(group, [x, y, h]) {
    group.setAttribute("transform", `translate(${x} ${-y}) rotate(${-h * 180 / Math.PI})`);
  }

  function draw(figure) {
    const clip = data.clips[Number(figure.dataset.clip)], last = clip.poses[0].length / 3 - 1;
    let reach = 1.6;  // [m] half the height of the picture
    for (const index of clip.pair) {
      for (let at = Math.max(clip.touch - 16, 0); at <= clip.touch; at += 4) {
        const [x, y] = pose(clip, index, at);
        reach = Math.min(Math.max(reach, Math.abs(x - clip.x) / 1.5 + 0.4, Math.abs(y - clip.y) + 0.4), 4.5);
      }
    }
    const wide = 1.5 * reach;
    const svg = make("svg", {viewBox: `${clip.x - wide} ${-clip.y - reach} ${2 * wide} ${2 * reach}`}, null);
    make("use", {href: `#track-${clip.track}`}, svg);
    for (const index of clip.cars.keys()) {
      const way = Array.from({length: last + 1}, (_, i) => pose(clip, index, i));
      const path = way.map(([x, y], i) =>
        `${i && Math.hypot(x - way[i - 1][0], y - way[i - 1][1]) < jump ? "L" : "M"}${x} ${-y}`).join("");
      make("path", {d: path, fill: "none", stroke: clip.colours[index], "stroke-width": 0.025, "stroke-opacity": 0.6}, svg);
      for (let at = clip.touch % 10; at < clip.touch; at += 10) put(car(clip, index, svg, true), pose(clip, index, at));
    }
    const cars = clip.cars.map((_, index) => car(clip, index, svg, false));
    make("circle", {cx: clip.x, cy: -clip.y, r: 0.16, fill: "none", stroke: "#d00000", "stroke-width": 0.035}, svg);
    const slider = document.createElement("input");
    Object.assign(slider, {type: "range", min: 0, max: last, step: "any", value: clip.touch});
    slider.setAttribute("aria-label", "time");
    let playing = 0;
    const show = at => cars.forEach((group, index) => put(group, pose(clip, index, at)));
    slider.addEventListener("input", () => { playing += 1; show(Number(slider.value)); });
    svg.addEventListener("click", () => {
      const mine = playing += 1, from = performance.now();
      const move = now => {
        if (mine !== playing) return;
        const at = (now - from) / 1000 / clip.step / slow;
        show(Math.min(at, last));
        slider.value = Math.min(at, last);
        if (at < last) requestAnimationFrame(move);
      };
      requestAnimationFrame(move);
    });
    show(clip.touch);
    figure.querySelector(".picture").append(svg, slider);
  }

  const figures = [...document.querySelectorAll("figure[data-clip]")];
  const seen = new IntersectionObserver(entries => {
    for (const entry of entries) {
      if (entry.isIntersecting) { seen.unobserve(entry.target); draw(entry.target); }
    }
  }, {rootMargin: "600px"});
  figures.forEach(figure => seen.observe(figure));
  addEventListener("beforeprint", () => figures.forEach(figure => {
    seen.unobserve(figure);
    if (!figure.querySelector("svg")) draw(figure);
  }));
  const choice = document.getElementById("of-planner");
  choice.addEventListener("change", () => figures.forEach(figure => {
    figure.hidden = choice.value !== "" && !figure.dataset.cars.split("|").includes(choice.value);
  }));
})();
