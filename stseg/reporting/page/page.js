// The report's moving pictures: the plan, a slice and the tracks in space and time, at the moment of the slider.
// It reads the page's own data and asks for nothing else. A frame in the address, report.html#frame=120, is where it starts.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  if (!data.frames.length) return;
  const element = (id) => document.getElementById(id);
  const [x0, x1] = data.x, [y0, y1] = data.y;
  const INK = "#2a2e34", QUIET = "#7c828a", RULE = "#d5d9de", GHOST = "#8a6d3b";
  const TRAIL = 5; // seconds
  let moment = 0, picked = -1, chosen = null; // the track whose whole path is shown

  // ---- data ----

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const tracks = (() => {
    const t = data.tracks;
    const frame = new Int32Array(bytes(t.frame).buffer);
    const x = new Int16Array(bytes(t.x).buffer), y = new Int16Array(bytes(t.y).buffer);
    const left = Math.round(x0 / t.quantum), low = Math.round(y0 / t.quantum);
    let start = 0;
    return t.ids.map((id, k) => {
      const stop = start + t.counts[k];
      const own = {
        id, name: t.names[k] || `${id}`, colour: t.colours[k], frame: frame.subarray(start, stop),
        x: Float32Array.from(x.subarray(start, stop), (v) => (v + left) * t.quantum),
        y: Float32Array.from(y.subarray(start, stop), (v) => (v + low) * t.quantum),
      };
      start = stop;
      return own;
    });
  })();

  // First row of a track at or after a frame.
  const rowAt = (track, frame) => {
    let low = 0, high = track.frame.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (track.frame[middle] < frame) low = middle + 1; else high = middle;
    }
    return low;
  };
  const people = (frame) => tracks.flatMap((track) => {
    const row = rowAt(track, frame);
    return track.frame[row] === frame ? [{ track, x: track.x[row], y: track.y[row] }] : [];
  });
  const now = () => data.frames[moment];

  const clock = (seconds) => {
    if (seconds < 60) return `${seconds.toFixed(1)} s`;
    const whole = Math.round(seconds), two = (n) => String(n).padStart(2, "0");
    const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
    return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
  };

  // ---- drawing on the ground ----

  // A canvas in device pixels, and the metres that it shows; `shape` is its height over its width.
  const prepare = (canvas, shape) => {
    const width = canvas.clientWidth, height = Math.round(width * shape), ratio = window.devicePixelRatio || 1;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    pen.lineJoin = pen.lineCap = "round";
    return { pen, width, height };
  };

  const MARGIN = 30;
  const groundShape = Math.min(1.6, Math.max(0.6, (y1 - y0) / (x1 - x0)));
  const ground = (canvas) => {
    const page = prepare(canvas, groundShape);
    const scale = Math.min((page.width - 2 * MARGIN) / (x1 - x0), (page.height - 2 * MARGIN) / (y1 - y0));
    const left = (page.width - scale * (x1 - x0)) / 2, top = (page.height - scale * (y1 - y0)) / 2;
    return {
      ...page, scale, left, top, u: (x) => left + (x - x0) * scale, v: (y) => top + (y1 - y) * scale,
      x: (u) => x0 + (u - left) / scale, y: (v) => y1 - (v - top) / scale,
    };
  };

  const stepOf = (scale, apart) => [0.5, 1, 2, 5, 10, 20, 50, 100].find((step) => step * scale >= apart) || 200;
  const rule = (map) => {
    const { pen, u, v } = map, step = stepOf(map.scale, 44);
    pen.strokeStyle = "rgba(120,128,138,0.25)";
    pen.fillStyle = QUIET;
    pen.lineWidth = 1;
    pen.textAlign = "center";
    for (let x = Math.ceil(x0 / step) * step; x <= x1 + 1e-9; x += step) {
      line(pen, [[u(x), v(y0)], [u(x), v(y1)]]);
      pen.fillText(`${+x.toFixed(2)}`, u(x), v(y0) + 16);
    }
    pen.textAlign = "right";
    for (let y = Math.ceil(y0 / step) * step; y <= y1 + 1e-9; y += step) {
      line(pen, [[u(x0), v(y)], [u(x1), v(y)]]);
      pen.fillText(`${+y.toFixed(2)}`, u(x0) - 6, v(y) + 4);
    }
    pen.strokeStyle = INK;
    const border = data.polygon || [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    line(pen, [...border, border[0]].map(([x, y]) => [u(x), v(y)]));
  };
  const line = (pen, points) => {
    pen.beginPath();
    points.forEach(([u, v], k) => (k ? pen.lineTo(u, v) : pen.moveTo(u, v)));
    pen.stroke();
  };
  const disc = (pen, u, v, radius, colour) => {
    pen.beginPath();
    pen.arc(u, v, radius, 0, 2 * Math.PI);
    pen.fillStyle = colour;
    pen.fill();
  };
  // A white word on a plate, held inside the canvas.
  const chip = (map, words, u, v, colour) => {
    const { pen } = map, wide = pen.measureText(words).width + 12;
    u = Math.min(Math.max(u, wide / 2 + 2), map.width - wide / 2 - 2);
    v = Math.min(Math.max(v, 11), map.height - 11);
    pen.fillStyle = colour;
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.roundRect(u - wide / 2, v - 9, wide, 18, 6);
    pen.fill();
    pen.stroke();
    pen.fillStyle = "#fff";
    pen.textAlign = "center";
    pen.fillText(words, u, v + 4);
  };
  const markPeople = (map) => people(now()).forEach(({ track, x, y }) => {
    disc(map.pen, map.u(x), map.v(y), 7, "#fff");
    disc(map.pen, map.u(x), map.v(y), 5.5, track.colour);
    chip(map, track.name, map.u(x) + 17, map.v(y) - 14, track.colour);
  });

  // ---- the plan ----

  const coverage = (() => {
    const [tall, wide] = data.coverage.shape, views = bytes(data.coverage.views);
    const sheet = new OffscreenCanvas(wide, tall), pen = sheet.getContext("2d"), picture = pen.createImageData(wide, tall);
    const most = Math.max(1, data.cameras.length);
    views.forEach((count, k) => {
      const share = Math.max(0, count - 1) / Math.max(1, most - 1);
      const tone = count === 0 ? [190, 60, 60] : count === 1 ? [250, 190, 120] : [195, 199, 206].map((t) => t + (251 - t) * share);
      picture.data.set([...tone, 255], 4 * k);
    });
    pen.putImageData(picture, 0, 0);
    return sheet;
  })();

  const letter = (k) => (k < 26 ? "" : String.fromCharCode(96 + Math.floor(k / 26))) + String.fromCharCode(97 + (k % 26));
  const ghosts = () => (data.candidates[moment] || []).filter((candidate) => candidate[3] >= 0);

  const drawPlan = () => {
    const map = ground(element("plan")), { pen, u, v } = map;
    pen.imageSmoothingEnabled = false;
    pen.drawImage(coverage, u(x0), v(y1), (x1 - x0) * map.scale, (y1 - y0) * map.scale);
    rule(map);
    data.stands.forEach(([x, y], k) => {
      if (x < x0 || x > x1 || y < y0 || y > y1) return;
      disc(pen, u(x), v(y), 4, INK);
      pen.textAlign = "center";
      pen.fillText(data.cameras[k], u(x), v(y) - 8);
    });
    const back = now() - TRAIL * data.frameRate;
    tracks.forEach((track) => {
      const [first, last] = track === chosen ? [0, track.frame.length] : [rowAt(track, back), rowAt(track, now() + 1)];
      if (chosen && track !== chosen) return;
      pen.strokeStyle = track.colour;
      pen.lineWidth = 2.5;
      if (last - first > 1) line(pen, Array.from({ length: last - first }, (_, k) => [u(track.x[first + k]), v(track.y[first + k])]));
    });
    ghosts().forEach(([x, y], k) => {
      pen.strokeStyle = k === picked ? "#c40000" : GHOST;
      pen.lineWidth = k === picked ? 3 : 1.6;
      line(pen, [[u(x) - 4, v(y) - 4], [u(x) + 4, v(y) + 4]]);
      line(pen, [[u(x) - 4, v(y) + 4], [u(x) + 4, v(y) - 4]]);
      pen.fillStyle = pen.strokeStyle;
      pen.textAlign = "left";
      pen.fillText(letter(k), u(x) + 7, v(y) + 4);
    });
    areas.draw(map, people(now()));
    markPeople(map);
  };
  const areas = zoneDrawing(element("plan"), () => drawPlan());

  // ---- the slice ----

  const STOPS = [[84, 128, 176], [176, 204, 230], [249, 249, 249], [253, 184, 110], [222, 104, 34]];
  const tones = Array.from({ length: 128 }, (_, grey) => {
    const place = Math.max(0, grey - 1) / 126 * 4, k = Math.min(3, Math.floor(place));
    return STOPS[k].map((tone, c) => Math.round(tone + (STOPS[k + 1][c] - tone) * (place - k)));
  });
  let shown = { moment: -1, grey: null };

  // The greys of the moment's sheet, 4 bytes a cell; a newer moment passes an older one that is still being decoded.
  const withSheet = (use) => {
    if (shown.moment === moment) return use(shown.grey);
    const wanted = moment, image = new Image(), [planes, tall, wide] = data.volume.shape;
    image.onload = () => {
      if (wanted !== moment) return;
      const sheet = new OffscreenCanvas(wide, planes * tall), pen = sheet.getContext("2d", { willReadFrequently: true });
      pen.drawImage(image, 0, 0);
      shown = { moment, grey: pen.getImageData(0, 0, wide, planes * tall).data };
      use(shown.grey);
    };
    image.src = `data:image/png;base64,${data.volume.sheets[wanted]}`;
  };

  const drawSlice = () => withSheet((grey) => {
    const [planes, tall, wide] = data.volume.shape, choice = element("plane").value;
    const sheet = new OffscreenCanvas(wide, tall), own = sheet.getContext("2d"), picture = own.createImageData(wide, tall);
    for (let k = 0; k < tall * wide; k++) {
      let level = 0;
      if (choice === "greatest") for (let p = 0; p < planes; p++) level = Math.max(level, grey[4 * (p * tall * wide + k)]);
      else level = grey[4 * (Number(choice) * tall * wide + k)];
      picture.data.set([...(level ? tones[Math.min(level, 127)] : [214, 217, 221]), 255], 4 * k);
    }
    own.putImageData(picture, 0, 0);
    const map = ground(element("slice"));
    map.pen.imageSmoothingEnabled = false;
    map.pen.drawImage(sheet, map.u(x0), map.v(y1), (x1 - x0) * map.scale, (y1 - y0) * map.scale);
    rule(map);
    people(now()).forEach(({ track, x, y }) => {
      map.pen.strokeStyle = track.colour;
      map.pen.lineWidth = 2.5;
      map.pen.beginPath();
      map.pen.arc(map.u(x), map.v(y), Math.max(6, 0.3 * map.scale), 0, 2 * Math.PI);
      map.pen.stroke();
      chip(map, track.name, map.u(x) + Math.max(17, 0.4 * map.scale), map.v(y) - 14, track.colour);
    });
    element("slice").dataset.frame = String(now());
  });

  // ---- what was weighed at the moment ----

  const sees = (nats) => (nats <= -1 ? "no" : nats >= 1 ? "yes" : "?");
  const fillWeighed = () => {
    const body = element("weighed");
    body.replaceChildren();
    let k = 0;
    (data.candidates[moment] || []).forEach(([x, y, evidence, reason, parts]) => {
      const row = body.insertRow(), ghost = reason >= 0, own = k;
      const cells = [ghost ? `ghost ${letter(k++)}` : "person", `${x.toFixed(2)}, ${y.toFixed(2)}`, evidence.toFixed(1)];
      cells.forEach((words) => (row.insertCell().textContent = words));
      parts.forEach((nats) => {
        const cell = row.insertCell(), answer = sees(nats);
        cell.textContent = `${answer} ${nats > 0 ? "+" : ""}${nats.toFixed(1)}`;
        cell.className = { no: "no", yes: "yes", "?": "unsure" }[answer];
      });
      row.insertCell().textContent = ghost ? data.reasons[reason] : "";
      row.className = ghost ? "ghost" : "";
      if (ghost) {
        row.onmouseenter = () => { picked = own; drawPlan(); };
        row.onmouseleave = () => { picked = -1; drawPlan(); };
      }
    });
    if (!body.rows.length) body.insertRow().insertCell().textContent = "no candidates";
  };

  // ---- space and time ----

  const eye = { azimuth: -0.56, elevation: 0.5 };
  const MOST_POINTS = 40000;
  const drawThread = () => {
    const page = prepare(element("thread"), 1), { pen } = page;
    const half = Number(element("span").value) * data.frameRate / 2;
    const all = [data.frames[0], Math.max(data.frames[data.frames.length - 1], data.frames[0] + 1)];
    const span = half ? [Math.max(all[0], now() - half), Math.min(all[1], now() + half)] : all;
    if (span[1] <= span[0]) span[1] = span[0] + 1;
    const side = Math.max(x1 - x0, y1 - y0), scale = 0.62 * (page.width - 90) / side;
    const [s, c] = [Math.sin(eye.azimuth), Math.cos(eye.azimuth)], [low, high] = [Math.sin(eye.elevation), Math.cos(eye.elevation)];
    const place = (x, y, frame) => {
      const a = x - (x0 + x1) / 2, b = y - (y0 + y1) / 2, t = ((frame - span[0]) / (span[1] - span[0]) - 0.5) * side;
      return [page.width / 2 + scale * (c * a - s * b), page.height / 2 - scale * (low * (s * a + c * b) + high * t)];
    };
    const floor = (frame) => [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]].map(([x, y]) => place(x, y, frame));
    const step = stepOf(scale, 16);
    pen.strokeStyle = RULE;
    for (let x = Math.ceil(x0 / step) * step; x <= x1 + 1e-9; x += step) line(pen, [place(x, y0, span[0]), place(x, y1, span[0])]);
    for (let y = Math.ceil(y0 / step) * step; y <= y1 + 1e-9; y += step) line(pen, [place(x0, y, span[0]), place(x1, y, span[0])]);
    pen.strokeStyle = INK;
    line(pen, floor(span[0]));
    drawClock(pen, span, place);
    nameAxes(page, span, place);
    const far = (track) => { const k = track.x.length >> 1; return s * track.x[k] + c * track.y[k]; };
    const near = tracks.map((track) => ({ track, first: rowAt(track, span[0]), last: rowAt(track, span[1] + 1) }))
      .filter(({ first, last }) => last > first).sort((a, b) => far(b.track) - far(a.track));
    const every = Math.max(1, Math.ceil(near.reduce((sum, part) => sum + part.last - part.first, 0) / MOST_POINTS));
    near.forEach(({ track, first, last }) => {
      const middle = Math.min(last, Math.max(first, rowAt(track, now() + 1)));
      if (chosen && track !== chosen) return thread(pen, place, track, first, last, every, 0.06);
      thread(pen, place, track, first, middle, every, 1);
      thread(pen, place, track, Math.max(first, middle - 1), last, every, 0.28);
    });
    pen.fillStyle = "rgba(11,112,216,0.07)";
    pen.strokeStyle = "rgba(11,112,216,0.7)";
    pen.lineWidth = 1.2;
    line(pen, floor(now()));
    pen.fill();
    people(now()).forEach(({ track, x, y }) => {
      const [u, v] = place(x, y, now());
      disc(pen, u, v, 6, "#fff");
      disc(pen, u, v, 4.5, track.colour);
      chip(page, track.name, u + 15, v - 12, track.colour);
    });
  };
  const thread = (pen, place, track, first, last, every, opacity) => {
    if (last - first < 2) return;
    const points = [];
    for (let k = first; k < last; k += every) points.push(place(track.x[k], track.y[k], track.frame[k]));
    points.push(place(track.x[last - 1], track.y[last - 1], track.frame[last - 1]));
    pen.globalAlpha = opacity;
    pen.lineWidth = tracks.length > 60 ? 1.2 : 2.2;
    pen.strokeStyle = track.colour;
    line(pen, points);
    pen.globalAlpha = 1;
  };
  // The upright axis at the leftmost corner.
  const drawClock = (pen, span, place) => {
    const corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    const [x, y] = corners.reduce((a, b) => (place(...a, span[0])[0] <= place(...b, span[0])[0] ? a : b));
    line(pen, [place(x, y, span[0]), place(x, y, span[1])]);
    pen.fillStyle = QUIET;
    pen.textAlign = "right";
    for (let k = 0; k <= 4; k++) {
      const frame = span[0] + (span[1] - span[0]) * k / 4, [u, v] = place(x, y, frame);
      line(pen, [[u - 5, v], [u, v]]);
      pen.fillText(clock(frame / data.frameRate), u - 9, v + 4);
    }
  };

  // What x and y span, beside the edges of the ground that are nearest to who looks.
  const nameAxes = ({ pen, height }, span, place) => {
    const middle = (x, y) => place(x, y, span[0]);
    const lower = (a, b) => (a[1] >= b[1] ? a : b);
    pen.fillStyle = QUIET;
    [["x", x0, x1, lower(middle((x0 + x1) / 2, y0), middle((x0 + x1) / 2, y1))],
      ["y", y0, y1, lower(middle(x0, (y0 + y1) / 2), middle(x1, (y0 + y1) / 2))]].forEach(([name, from, to, [u, v]]) => {
      pen.textAlign = u < middle((x0 + x1) / 2, (y0 + y1) / 2)[0] ? "right" : "left";
      pen.fillText(`${name}: ${+from.toFixed(1)} to ${+to.toFixed(1)} m`, u, Math.min(v + 20, height - 4));
    });
  };

  // ---- the time bar ----

  const slider = element("slider");
  const show = (index) => {
    moment = Math.min(Math.max(index, 0), data.frames.length - 1);
    picked = -1;
    slider.value = String(moment);
    const there = people(now()).length, dropped = data.ghosts[moment];
    element("clock").textContent = `${clock(now() / data.frameRate)}, frame ${now()}: ${there} people, ${dropped} ghosts dropped`;
    drawPlan();
    drawSlice();
    drawThread();
    fillWeighed();
  };
  const nearest = (frame) => data.frames.reduce((best, own, k) => (Math.abs(own - frame) < Math.abs(data.frames[best] - frame) ? k : best), 0);
  const fromAddress = () => {
    const found = /frame=(\d+)/.exec(location.hash);
    return found ? nearest(Number(found[1])) : Math.floor(data.frames.length / 2);
  };

  let timer = 0;
  const stop = () => { clearInterval(timer); timer = 0; element("play").textContent = "Play"; };
  const play = () => {
    if (timer) return stop();
    element("play").textContent = "Stop";
    if (moment === data.frames.length - 1) show(0);
    const apart = 1000 * (data.frames[data.frames.length - 1] - data.frames[0]) / data.frameRate / Math.max(1, data.frames.length - 1);
    timer = setInterval(() => (moment < data.frames.length - 1 ? show(moment + 1) : stop()), Math.min(Math.max(apart, 60), 200));
  };

  data.heights.forEach((height, k) => element("plane").add(new Option(`plane at ${height.toFixed(2)} m`, String(k))));
  const whole = (data.frames[data.frames.length - 1] - data.frames[0]) / data.frameRate;
  [10, 60, 600].filter((seconds) => 2 * seconds < whole).forEach((seconds) =>
    element("span").add(new Option(`${clock(seconds)} around the moment`, String(seconds))));
  slider.max = String(data.frames.length - 1);
  slider.oninput = () => { stop(); show(Number(slider.value)); };
  element("play").onclick = play;
  element("plane").onchange = drawSlice;
  element("span").onchange = drawThread;
  tracks.forEach((track, k) => element("whose").add(new Option(`of track ${track.name}`, String(k))));
  element("whose").onchange = () => { chosen = tracks[element("whose").value] || null; drawPlan(); drawThread(); };
  window.onresize = () => show(moment);
  window.onhashchange = () => show(fromAddress());
  const canvas = element("thread");
  canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
  canvas.onpointermove = (event) => {
    if (!event.buttons) return;
    eye.azimuth += event.movementX * 0.008;
    eye.elevation = Math.min(1.55, Math.max(0.02, eye.elevation + event.movementY * 0.006));
    drawThread();
  };
  document.body.classList.add("scripted");
  show(fromAddress());
})();
