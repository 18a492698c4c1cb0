// Draws one decision after the other: the scan from above, range over bearing, and which step chose the command.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const { decisions, car } = data;
  const element = (id) => document.getElementById(id);
  const hidden = new Set(["filtered"].filter((name) => data.scans.some(([other]) => other === name)));
  const unpacked = new Map();
  let shown = data.at, reach = 6, timer = 0, ink, soft, line, paper;

  // ---- what is in the page

  function scansOf(place) {
    if (!unpacked.has(place)) {
      const found = {};
      for (const [name, text] of Object.entries(decisions[place].scans)) {
        const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
        const counts = new DataView(bytes.buffer);
        found[name] = Float32Array.from({ length: bytes.length / 2 }, (_, i) => {
          const count = counts.getUint16(2 * i, true);
          return count === data.missing ? NaN : count * data.unit;
        });
      }
      unpacked.set(place, found);
      if (unpacked.size > 40) unpacked.delete(unpacked.keys().next().value);
    }
    return unpacked.get(place);
  }
  const heldSpeed = (command) => Math.max(car.slowest, Math.min(car.fastest, command[1]));  // by the car [m/s]
  const degrees = (angle) => angle * 180 / Math.PI;
  const written = (value, digits) => value === null ? "–" : (Math.round(value * 10 ** digits) / 10 ** digits + 0).toFixed(digits);
  const colourOf = (name) => (data.laws.find(([law]) => law === name) || [name, "#5d6570"])[1];

  function canvasOf(id) {
    const canvas = typeof id === "string" ? element(id) : id, ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "12px system-ui, sans-serif";
    return [pen, box.width, box.height];
  }

  // ---- from above: x ahead is up, y to the left is left

  function drawTop(decision) {
    const [pen, width, height] = canvasOf("top");
    const middle = width / 2, base = height * 0.76, scale = base / reach;
    const at = (x, y) => [middle - y * scale, base - x * scale];
    const trace = (points, close) => {
      pen.beginPath();
      points.forEach(([x, y], i) => pen[i ? "lineTo" : "moveTo"](...at(x, y)));
      if (close) pen.closePath();
    };
    pen.fillStyle = paper;
    pen.fillRect(0, 0, width, height);

    pen.strokeStyle = line;
    pen.lineWidth = 1;
    const step = reach > 6 ? 2 : reach > 3 ? 1 : 0.5;
    for (let r = step; r <= 1.3 * reach; r += step) {
      pen.beginPath();
      pen.arc(...at(car.lidar, 0), r * scale, 0, 2 * Math.PI);
      pen.stroke();
      if (r % (2 * step) === 0) { pen.fillStyle = soft; pen.fillText(r + " m", at(car.lidar, 0)[0] + 4, at(car.lidar, 0)[1] - r * scale - 3); }
    }

    const [px, py, heading] = decision.pose, cos = Math.cos(heading), sin = Math.sin(heading);
    const local = ([x, y]) => [cos * (x - px) + sin * (y - py), cos * (y - py) - sin * (x - px)];
    if (px !== null && py !== null && heading !== null) {
      pen.globalAlpha = 0.22;
      pen.fillStyle = pen.strokeStyle = soft;
      for (const outline of data.walls) { trace(outline.map(local), true); pen.fill(); pen.stroke(); }
      pen.globalAlpha = 0.5;
      for (const outline of decision.moving) { trace(outline.map(local), true); pen.fill(); }
      pen.globalAlpha = 1;
    }

    const scans = scansOf(shown), raw = scans.raw;
    const end = (range, beam) => {
      const bearing = data.scan.min + data.scan.step * beam;
      return [car.lidar + range * Math.cos(bearing), range * Math.sin(bearing)];
    };
    for (const [name, colour] of data.scans) {
      const ranges = scans[name];
      if (!ranges || hidden.has(name)) continue;
      pen.strokeStyle = pen.fillStyle = colour;
      if (name === "gap") {
        pen.globalAlpha = 0.2;
        for (const [first, last] of runs(ranges, (range) => range === range)) {
          pen.beginPath();
          pen.moveTo(...at(car.lidar, 0));
          for (let beam = first; beam < last; beam++) pen.lineTo(...at(...end(ranges[beam], beam)));
          pen.closePath();
          pen.fill();
        }
        pen.globalAlpha = 1;
      } else if (name === "raw") {
        for (let beam = 0; beam < ranges.length; beam++) {
          if (!(ranges[beam] > 0) || ranges[beam] >= data.scan.max * 0.999) continue;
          const [x, y] = at(...end(ranges[beam], beam));
          pen.fillRect(x - 1.6, y - 1.6, 3.2, 3.2);
        }
      } else if (name === "bubble") {  // what it took away
        for (let beam = 0; beam < ranges.length; beam++) {
          if (ranges[beam] !== 0 || !(raw[beam] > 0)) continue;
          const [x, y] = at(...end(raw[beam], beam));
          pen.fillRect(x - 2.4, y - 2.4, 4.8, 4.8);
        }
      } else {
        pen.lineWidth = 1.4;
        for (const [first, last] of runs(ranges, (range) => range === range)) {
          pen.beginPath();
          for (let beam = first; beam < last; beam++) pen[beam > first ? "lineTo" : "moveTo"](...at(...end(ranges[beam], beam)));
          pen.stroke();
        }
      }
    }

    for (const [name, colour, points] of decision.drawn) {
      if (hidden.has("drawn " + name)) continue;
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = 2;
      for (const found of points) {
        if (Array.isArray(found[0])) { trace(found, false); pen.stroke(); }
        else { pen.beginPath(); pen.arc(...at(...found), points.length > 50 ? 1.8 : 4, 0, 7); pen.fill(); }
      }
    }

    if (decision.motion.length > 1) {
      pen.strokeStyle = "#a04bd0";
      pen.lineWidth = 5;
      pen.globalAlpha = 0.75;
      trace(decision.motion, false);
      pen.stroke();
      pen.globalAlpha = 1;
    }
    const own = decision.steps.find(([name, angle]) => name === "planner" && angle !== null);
    if (decision.command) {
      const speed = heldSpeed(decision.command), way = Math.sign(speed || 1) * Math.max(0.5 * Math.abs(speed), 0.5);
      if (own && Math.abs(own[1] - decision.command[0]) > 1e-3) drawArc(own[1], way, soft, 2, [5, 5]);
      drawArc(decision.command[0], way, "#2f7ed8", 3.5, []);
    }
    if (px !== null && py !== null && heading !== null) {  // where it was, before and after
      const now = data.before + shown, way = data.driven.slice(Math.max(now - data.ahead, 0), now + data.ahead + 1)
        .filter(([x, y]) => x !== null && y !== null);
      pen.strokeStyle = data.driven_colour;
      pen.lineWidth = 2.5;
      pen.setLineDash([7, 3]);
      trace(way.map(local), false);
      pen.stroke();
      pen.setLineDash([]);
    }
    function drawArc(angle, way, colour, thick, dash) {
      const curvature = Math.tan(Math.max(-car.lock, Math.min(car.lock, angle))) / car.wheelbase;
      pen.strokeStyle = colour;
      pen.lineWidth = thick;
      pen.setLineDash(dash);
      trace(Array.from({ length: 25 }, (_, i) => {
        const along = way * i / 24, turn = curvature * along;
        return Math.abs(turn) < 1e-6 ? [along, 0.5 * turn * along] : [Math.sin(turn) / curvature, (1 - Math.cos(turn)) / curvature];
      }), false);
      pen.stroke();
      pen.setLineDash([]);
    }

    pen.fillStyle = ink;
    pen.globalAlpha = 0.85;
    const back = -car.rear, front = car.length - car.rear, side = car.width / 2;
    trace([[back, -side], [front, -side], [front, side], [back, side]], true);
    pen.fill();
    pen.globalAlpha = 1;
    pen.strokeStyle = paper;
    pen.lineWidth = 2;
    for (const across of [-0.7 * side, 0.7 * side]) {  // front wheels, as they are turned
      const c = 0.05 * Math.cos(decision.angle || 0), s = 0.05 * Math.sin(decision.angle || 0);
      trace([[car.wheelbase - c, across - s], [car.wheelbase + c, across + s]], false);
      pen.stroke();
    }
    pen.fillStyle = "#e0314b";
    pen.beginPath();
    pen.arc(...at(car.lidar, 0), 3, 0, 7);
    pen.fill();

    if (decision.goal) {
      const [x, y] = at(...decision.goal), [x0, y0] = at(car.lidar, 0);
      pen.strokeStyle = pen.fillStyle = "#12a066";
      pen.lineWidth = 1.5;
      pen.setLineDash([2, 4]);
      pen.beginPath();
      pen.moveTo(x0, y0);
      pen.lineTo(x, y);
      pen.stroke();
      pen.setLineDash([]);
      // a goal beyond the picture is shown on its edge
      const out = Math.min(1, (x > x0 ? width - 12 - x0 : x0 - 12) / Math.max(Math.abs(x - x0), 1e-6),
        (y > y0 ? height - 12 - y0 : y0 - 12) / Math.max(Math.abs(y - y0), 1e-6));
      const gx = x0 + out * (x - x0), gy = y0 + out * (y - y0);
      pen.strokeStyle = paper;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(gx, gy, 7, 0, 7);
      pen.fill();
      pen.stroke();
      pen.fillStyle = ink;
      pen.fillText(out < 1 ? "goal, farther on" : "goal", Math.max(Math.min(gx - 13, width - 96), 4), gy > 24 ? gy - 12 : gy + 22);
    }
  }

  function runs(ranges, holds) {
    const found = [];
    let first = -1;
    for (let beam = 0; beam <= ranges.length; beam++) {
      const inside = beam < ranges.length && holds(ranges[beam]);
      if (inside && first < 0) first = beam;
      if (!inside && first >= 0) { found.push([first, beam]); first = -1; }
    }
    return found;
  }

  // ---- range over bearing: left is left

  function drawRanges(decision) {
    const [pen, width, height] = canvasOf("ranges");
    const scans = scansOf(shown), count = scans.raw.length;
    const low = degrees(data.scan.min), high = low + degrees(data.scan.step) * Math.max(count - 1, 1);
    let top = 1;
    for (const range of scans.raw) if (range > top && range < data.scan.max * 0.999) top = range;
    top = Math.min(top * 1.08, data.scan.max);
    const left = 52, right = 22, bottom = height - 36;  // the labels of the first and the last tick have room
    const across = (bearing) => left + (high - bearing) / (high - low) * (width - left - right);
    const up = (range) => bottom - Math.min(range, top) / top * (bottom - 8);
    pen.strokeStyle = line;
    pen.fillStyle = soft;
    pen.lineWidth = 1;
    pen.textAlign = "center";
    for (let bearing = Math.ceil(low / 45) * 45; bearing <= high; bearing += 45) {
      stroke(pen, [[across(bearing), 8], [across(bearing), bottom]]);
      pen.fillText(bearing + "°", across(bearing), bottom + 17);
    }
    pen.fillText("bearing, left is left", (left + width - right) / 2, bottom + 32);
    pen.textAlign = "right";
    const step = [0.5, 1, 2, 5, 10, 20, 50].find((each) => top / each <= 6) || 100;
    for (let range = 0; range <= top; range += step) {
      stroke(pen, [[left, up(range)], [width - right, up(range)]]);
      pen.fillText(range + " m", left - 8, up(range) + 4);
    }
    pen.textAlign = "left";
    for (const [name, colour] of data.scans) {
      const ranges = scans[name];
      if (!ranges || hidden.has(name)) continue;
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = name === "raw" ? 2.5 : 1.4;
      pen.globalAlpha = name === "raw" ? 0.55 : 1;
      const place = (beam) => [across(low + degrees(data.scan.step) * beam), up(ranges[beam])];
      for (const [first, last] of runs(ranges, (range) => range === range)) {
        const points = Array.from({ length: last - first }, (_, i) => place(first + i));
        if (name === "gap") {
          pen.globalAlpha = 0.2;
          pen.beginPath();
          pen.moveTo(points[0][0], bottom);
          for (const point of points) pen.lineTo(...point);
          pen.lineTo(points[points.length - 1][0], bottom);
          pen.fill();
        } else stroke(pen, points);
      }
      pen.globalAlpha = 1;
    }
    if (decision.goal) {
      const bearing = degrees(Math.atan2(decision.goal[1], decision.goal[0] - car.lidar));
      pen.strokeStyle = "#12a066";
      pen.lineWidth = 2;
      pen.setLineDash([2, 4]);
      stroke(pen, [[across(bearing), 8], [across(bearing), bottom]]);
      pen.setLineDash([]);
      pen.fillStyle = ink;
      pen.fillText("goal", Math.min(across(bearing) + 5, width - 40), 18);
    }
  }

  function stroke(pen, points) {
    pen.beginPath();
    points.forEach(([x, y], i) => pen[i ? "lineTo" : "moveTo"](x, y));
    pen.stroke();
  }

  // ---- the window: speed over time, and a band in the colour of the step that chose it

  const stripLeft = 42;
  function drawStrip() {
    const [pen, width, height] = canvasOf("strip");
    const count = decisions.length, bottom = height - 20, band = 13;
    const across = (place) => stripLeft + (place + 0.5) / count * (width - stripLeft - 10);
    let top = 1, low = 0;
    const ground = (each) => each.motion_of_car && each.motion_of_car[0];
    for (const each of decisions) {
      top = Math.max(top, each.speed || 0, ground(each) || 0, each.command ? heldSpeed(each.command) : 0);
      low = Math.min(low, each.speed || 0, each.command ? heldSpeed(each.command) : 0);
    }
    const up = (speed) => bottom - (speed - low) / (top - low) * (bottom - band - 10);
    for (const [first, end, law] of data.stretches) {
      pen.fillStyle = data.laws[law][1];
      pen.fillRect(across(first - 0.5), 0, across(end - 0.5) - across(first - 0.5) + 0.5, band);
    }
    pen.strokeStyle = line;
    pen.fillStyle = soft;
    pen.textAlign = "right";
    const step = [0.5, 1, 2, 5, 10].find((each) => (top - low) / each <= 4) || 20;
    for (let speed = Math.ceil(low / step) * step; speed <= top; speed += step) {
      stroke(pen, [[stripLeft, up(speed)], [width - 10, up(speed)]]);
      pen.fillText(speed + "", stripLeft - 5, up(speed) + 4);
    }
    pen.fillText("m/s", stripLeft - 5, 11);
    pen.textAlign = "center";
    const room = pen.measureText("888.88 s").width + 10, labels = Math.max(1, Math.min(8, Math.floor((width - stripLeft - 10) / room)));
    const every = Math.max(1, Math.ceil(count / labels));
    for (let place = 0; place < count; place += every) {
      pen.fillText(decisions[place].time.toFixed(2) + " s", Math.max(Math.min(across(place), width - room / 2), stripLeft + room / 2), height - 5);
    }
    for (const [value, colour, thick] of [[(each) => each.command && heldSpeed(each.command), "#2f7ed8", 1.5],
      [(each) => each.speed, ink, 2], [ground, data.driven_colour, 1.5]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = thick;
      const points = decisions.map((each, place) => [across(place), value(each)]).filter(([, speed]) => typeof speed === "number");
      stroke(pen, points.map(([x, speed]) => [x, up(speed)]));
    }
    pen.strokeStyle = "#e0314b";
    pen.lineWidth = 1.5;
    stroke(pen, [[across(shown), 0], [across(shown), bottom]]);
    pen.textAlign = "left";
  }

  // ---- numbers that the planner shows, each over time in the row of its name

  const plots = Array.from(document.querySelectorAll("canvas.over_time"));
  function drawNumbers(decision) {
    plots.forEach((canvas, row) => {
      const name = data.numbers[row], now = decision.numbers[name];
      canvas.closest("tr").children[1].textContent = now === undefined ? "–" : typeof now === "number" ? short(now) : now;
      const [pen, width, height] = canvasOf(canvas);
      const values = decisions.map((each) => typeof each.numbers[name] === "number" ? each.numbers[name] : NaN);
      const known = values.filter((value) => value === value);
      let low = Math.min(...known), high = Math.max(...known);
      pen.fillStyle = soft;
      pen.textAlign = "right";
      if (known.length) pen.fillText(short(high), numberLeft - 6, 12);
      if (high > low) pen.fillText(short(low), numberLeft - 6, height - 4);
      else { low -= 1; high += 1; }
      const across = (place) => numberLeft + (place + 0.5) / values.length * (width - numberLeft - 4);
      const up = (value) => height - 6 - (value - low) / (high - low) * (height - 12);
      pen.strokeStyle = line;
      pen.lineWidth = 1;
      pen.strokeRect(numberLeft, 0.5, width - numberLeft - 4, height - 1);
      pen.strokeStyle = pen.fillStyle = ink;
      pen.lineWidth = 1.6;
      for (const [first, end] of runs(values, (value) => value === value)) {
        const points = Array.from({ length: end - first }, (_, i) => [across(first + i), up(values[first + i])]);
        if (points.length > 1) stroke(pen, points); else pen.fillRect(points[0][0] - 1.5, points[0][1] - 1.5, 3, 3);
      }
      pen.strokeStyle = "#e0314b";
      pen.lineWidth = 1.5;
      stroke(pen, [[across(shown), 0], [across(shown), height]]);
    });
  }
  const numberLeft = 64;
  const short = (value) => String(Number(value.toPrecision(4)));

  // ---- how the car moves

  function drawMotion(decision) {
    const [ground, sideslip, tires] = decision.motion_of_car || [null, null, []];
    const told = [[ground, 2, " m/s"], [decision.speed, 2, " m/s"], [sideslip === null ? null : degrees(sideslip), 1, "°"]];
    document.querySelectorAll("table.motion tbody tr").forEach((row, place) => {
      const [value, digits, unit] = told[place];
      row.children[1].textContent = written(value, digits) + (value === null ? "" : unit);
    });
    document.querySelectorAll("table.tires tbody tr").forEach((row, place) => {
      const [slide, use] = tires[place] || [null, null];
      row.children[1].textContent = written(slide, 3);
      row.children[2].textContent = written(use, 2);
      row.children[1].className = slide !== null && slide > data.slides_above ? "slides" : "";
    });
  }

  // ---- texts

  function tell(decision) {
    const command = decision.command;
    element("moment").textContent = `t = ${decision.time.toFixed(3)} s, decision ${decision.tick + 1}`;
    element("moment").dataset.tick = decision.tick;
    element("moment").dataset.command = command ? JSON.stringify(command) : "";
    element("slider").value = shown;
    for (const [id, which, digits, unit, of] of [["steering", 0, 1, "°", degrees], ["speed", 1, 2, " m/s", (v) => v]]) {
      element(id).textContent = command ? written(of(command[which]), digits) + unit : "none";
      element(id + "_why").textContent = decision.why[which];
      const held = decision.held[which], name = held === null ? "" : decision.steps[held][0];
      element(id + "_by").textContent = name;
      element(id + "_by").style.background = colourOf(name);
    }
    element("failure").hidden = !decision.failure;
    element("failure").textContent = decision.failure;
    const rows = document.querySelector("#steps tbody");
    rows.replaceChildren();
    let last = [null, null], onTheWay = false;
    decision.steps.forEach(([name, angle, speed, text, way], place) => {
      const row = rows.insertRow();
      if (way) row.className = onTheWay ? "way" : "way begins";
      onTheWay = way;
      const said = row.insertCell();
      said.textContent = name;
      if (text) { const small = document.createElement("small"); small.textContent = text; said.append(small); }
      [[angle, 1, degrees], [speed, 2, (v) => v]].forEach(([value, digits, of], which) => {
        const cell = row.insertCell();
        cell.textContent = value === null ? "–" : written(of(value), digits);
        if (place === decision.held[which]) cell.className = "holds";
        else if (value !== null && last[which] !== null && Math.abs(value - last[which]) > 1e-4) cell.className = "changed";
        if (value !== null && !way) last[which] = value;
      });
    });
    if (decision.same === false) {
      const cell = rows.insertRow().insertCell();
      cell.colSpan = 3;
      cell.textContent = "The planner answers another command now than the recorded one.";
    }
  }

  function show(place) {
    shown = Math.max(0, Math.min(decisions.length - 1, place));
    const decision = decisions[shown];
    drawStrip();
    drawTop(decision);
    drawRanges(decision);
    drawNumbers(decision);
    drawMotion(decision);
    tell(decision);
  }

  // ---- controls

  function play(on) {
    window.clearInterval(timer);
    timer = 0;
    element("play").textContent = on ? "❚❚ stop" : "▶ play";
    if (on) {
      if (shown === decisions.length - 1) show(0);
      timer = window.setInterval(() => { show(shown + 1); if (shown === decisions.length - 1) play(false); }, Math.max(4000 * data.period, 40));
    }
  }
  const acts = {
    first: () => show(0), last: () => show(decisions.length - 1), back: () => show(shown - 1), forward: () => show(shown + 1),
    play: () => play(!timer),
  };
  for (const [id, act] of Object.entries(acts)) element(id).addEventListener("click", () => { if (id !== "play") play(false); act(); });
  element("slider").addEventListener("input", (event) => { play(false); show(Number(event.target.value)); });
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? 10 : 1;
    const keys = { ArrowLeft: () => show(shown - by), ArrowRight: () => show(shown + by), Home: acts.first, End: acts.last, " ": acts.play };
    if (!keys[event.key]) return;
    event.preventDefault();
    if (event.key !== " ") play(false);
    keys[event.key]();
  });
  for (const [canvas, left, right] of [[element("strip"), stripLeft, 10], ...plots.map((each) => [each, numberLeft, 4])]) {
    const seek = (event) => {
      const box = canvas.getBoundingClientRect();
      play(false);
      show(Math.floor((event.clientX - box.left - left) / (box.width - left - right) * decisions.length));
    };
    canvas.addEventListener("pointerdown", seek);
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
  }
  page.wire("zoom", (value) => { reach = Number(value); drawTop(decisions[shown]); });
  const swatch = (colour) => {
    const mark = document.createElement("span");
    mark.className = "swatch";
    mark.style.background = colour;
    return mark;
  };
  for (const [name, colour] of data.laws) {
    const entry = document.createElement("span");
    entry.append(swatch(colour), name);
    element("laws").append(entry);
  }
  for (const [name, colour] of [["speed of the odometry", "var(--ink)"], ["over the ground", data.driven_colour], ["commanded speed", "#2f7ed8"]]) {
    const entry = document.createElement("span"), mark = swatch(colour);
    mark.style.height = "3px";
    entry.append(mark, name);
    element("laws").append(entry);
  }
  for (const [name, colour, layer] of [...data.scans.map(([name, colour]) => [name, colour, name]),
    ...data.drawn.map(([name, colour]) => [name, colour, "drawn " + name])]) {
    const entry = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = !hidden.has(layer);
    box.addEventListener("change", () => { hidden[box.checked ? "delete" : "add"](layer); show(shown); });
    entry.append(box, swatch(colour), name);
    element("layers").append(entry);
  }
  for (const [name, colour] of [["command, for 0.5 s", "#2f7ed8"], ["planner's own", "var(--soft)"], ["motion of guidance", "#a04bd0"],
    ["driven, 0.5 s before and after", data.driven_colour]]) {
    const entry = document.createElement("span"), mark = swatch(colour);
    mark.style.height = "3px";
    entry.append(mark, name);
    element("layers").append(entry);
  }

  window.addEventListener("resize", () => show(shown));
  page.painted(() => { [ink, soft, line, paper] = page.colours("ink", "soft", "line", "paper"); show(shown); });
  document.documentElement.dataset.ready = "yes";
})();
