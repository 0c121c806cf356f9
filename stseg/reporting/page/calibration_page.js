// Ground points by clicking: a place in two or more views and on the plan; homographies are solved as one clicks.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const element = (id) => document.getElementById(id);
  const [x0, y0, x1, y1] = data.area;
  const LINE = "#2f9fe0", POINT = "#d8322b", QUIET = "#7c828a", DARK = "#3d434c", HINT = "#e8a200";
  let points = [], active = -1, last = null, history = [];

  // ---- small linear algebra ----

  // Solves a symmetric or square system by Gauss with pivots; null where it is singular.
  const solve = (matrix, right) => {
    const n = right.length, a = matrix.map((row, k) => [...row, right[k]]);
    for (let i = 0; i < n; i++) {
      let best = i;
      for (let k = i + 1; k < n; k++) if (Math.abs(a[k][i]) > Math.abs(a[best][i])) best = k;
      if (Math.abs(a[best][i]) < 1e-12) return null;
      [a[i], a[best]] = [a[best], a[i]];
      for (let k = 0; k < n; k++) {
        if (k === i) continue;
        const share = a[k][i] / a[i][i];
        for (let j = i; j <= n; j++) a[k][j] -= share * a[i][j];
      }
    }
    return a.map((row, k) => row[n] / row[k]);
  };
  const normal = (rows) => rows[0].map((_, i) => rows[0].map((__, j) => rows.reduce((sum, row) => sum + row[i] * row[j], 0)));

  const middle = [(x0 + x1) / 2, (y0 + y1) / 2], reach = Math.max(x1 - x0, y1 - y0) / 2;
  const scaled = ([x, y]) => [(x - middle[0]) / reach, (y - middle[1]) / reach];

  // The homography of eight numbers from scaled ground to scaled pixels: direct linear transform, then Gauss-Newton.
  const project = (h, [x, y]) => {
    const w = h[6] * x + h[7] * y + 1;
    return [(h[0] * x + h[1] * y + h[2]) / w, (h[3] * x + h[4] * y + h[5]) / w];
  };
  const slopes = (h, [x, y]) => {
    const w = h[6] * x + h[7] * y + 1, [u, v] = project(h, [x, y]);
    return [
      [x / w, y / w, 1 / w, 0, 0, 0, -u * x / w, -u * y / w],
      [0, 0, 0, x / w, y / w, 1 / w, -v * x / w, -v * y / w],
    ];
  };
  const fit = (camera) => {
    const size = Math.max(camera.width, camera.height);
    const own = points.filter((point) => point.ground && !point.z && point.pixels[camera.name])
      .map((point) => ({ ground: scaled(point.ground), pixel: point.pixels[camera.name].map((p) => p / size) }));
    if (own.length < 4) return null;
    const rows = [], right = [];
    for (const { ground: [x, y], pixel: [u, v] } of own) {
      rows.push([x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]);
      right.push(u, v);
    }
    const times = (list, values) => list[0].map((_, i) => list.reduce((sum, row, k) => sum + row[i] * values[k], 0));
    let h = solve(normal(rows), times(rows, right));
    for (let round = 0; h && round < 5; round++) {
      const jacobian = own.flatMap(({ ground }) => slopes(h, ground));
      const miss = own.flatMap(({ ground, pixel }) => { const p = project(h, ground); return [pixel[0] - p[0], pixel[1] - p[1]]; });
      const step = solve(normal(jacobian), times(jacobian, miss));
      if (!step) break;
      h = h.map((value, k) => value + step[k]);
    }
    return h && { h, size, information: normal(own.flatMap(({ ground }) => slopes(h, ground))) };
  };
  const toPixel = (found, ground) => project(found.h, scaled(ground)).map((p) => p * found.size);
  const toGround = (found, pixel) => {
    const [a, b, c, d, e, f, g, i] = found.h, [u, v] = pixel.map((p) => p / found.size);
    const xy = solve([[a - u * g, b - u * i], [d - v * g, e - v * i]], [u - c, v - f]);
    return xy && [xy[0] * reach + middle[0], xy[1] * reach + middle[1]];
  };
  const ahead = (found, ground) => { const [x, y] = scaled(ground); return found.h[6] * x + found.h[7] * y + 1 > 0.02; };

  // The place on the ground, visible in a view, whose pixel is known worst.
  const hint = (camera, found) => {
    let best = null, worst = 0;
    for (let i = 0; i <= 12; i++) for (let j = 0; j <= 12; j++) {
      const ground = [x0 + (x1 - x0) * i / 12, y0 + (y1 - y0) * j / 12];
      const [u, v] = toPixel(found, ground);
      if (!ahead(found, ground) || u < 0 || v < 0 || u > camera.width || v > camera.height) continue;
      let variance = 0;
      for (const row of slopes(found.h, scaled(ground))) {
        const solved = solve(found.information, row);
        if (solved) variance += row.reduce((sum, value, k) => sum + value * solved[k], 0);
      }
      if (variance > worst) [worst, best] = [variance, ground];
    }
    return best;
  };

  // ---- views ----

  const sheets = [];
  const addSheet = (name, width, height, images, camera) => {
    const figure = document.createElement("figure"), canvas = document.createElement("canvas");
    const caption = document.createElement("figcaption");
    canvas.id = camera ? `view-${name}` : "plan";
    canvas.tabIndex = 0;
    figure.append(canvas, caption);
    element("sheets").append(figure);
    const sheet = { name, width, height, canvas, caption, camera, image: null, zoom: 1, left: 0, top: 0, at: null };
    sheet.images = images.map((source) => { const image = new Image(); image.onload = draw; image.src = source; return image; });
    sheet.image = sheet.images[0] || null;
    sheets.push(sheet);
    canvas.addEventListener("mousedown", (event) => press(sheet, event));
    canvas.addEventListener("mousemove", (event) => magnify(sheet, event));
    canvas.addEventListener("mouseleave", () => { element("lens").hidden = true; sheet.at = null; label(sheet); });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(sheet, event); }, { passive: false });
  };
  // As many columns as show all views and the plan largest in one window.
  const arrange = () => {
    const wide = element("sheets").clientWidth, high = Math.max(innerHeight - element("sheets").offsetTop - 8, 320);
    const sizes = (columns) => sheets.map((sheet) => {
      const across = (wide - 8 * (columns - 1)) / columns;
      const down = high / Math.ceil(sheets.length / columns) - 32;
      return Math.max(Math.min(across, down * sheet.width / sheet.height), 120);
    });
    const area = (columns) => sizes(columns).reduce((sum, width, k) => sum + width * width * sheets[k].height / sheets[k].width, 0);
    const columns = sheets.map((_, k) => k + 1).reduce((best, one) => (area(one) > area(best) ? one : best), 1);
    element("sheets").style.gridTemplateColumns = `repeat(${columns}, 1fr)`;
    sizes(columns).forEach((width, k) => { sheets[k].canvas.style.width = `${Math.floor(width)}px`; });
  };
  const scaleOf = (sheet) => sheet.canvas.width / sheet.width * sheet.zoom;
  const toCanvas = (sheet, [u, v]) => [(u + 0.5 - sheet.left) * scaleOf(sheet), (v + 0.5 - sheet.top) * scaleOf(sheet)];
  const fromEvent = (sheet, event) => {
    const box = sheet.canvas.getBoundingClientRect(), ratio = sheet.canvas.width / box.width;
    // Browsers round pointers down to whole pixels: their middle is meant.
    return [(event.clientX + 0.5 - box.left) * ratio / scaleOf(sheet) + sheet.left - 0.5,
      (event.clientY + 0.5 - box.top) * ratio / scaleOf(sheet) + sheet.top - 0.5];
  };
  const planScale = data.plan.scale; // pixels a metre
  const planPixel = ([x, y]) => [(x - x0) * planScale - 0.5, (y1 - y) * planScale - 0.5];
  const planGround = ([u, v]) => [x0 + (u + 0.5) / planScale, y1 - (v + 0.5) / planScale];

  const zoom = (sheet, event) => {
    const [u, v] = fromEvent(sheet, event), factor = event.deltaY < 0 ? 1.25 : 0.8;
    const before = sheet.zoom;
    sheet.zoom = Math.min(16, Math.max(1, sheet.zoom * factor));
    const share = before / sheet.zoom;
    sheet.left = Math.min(Math.max(u - (u - sheet.left) * share, 0), sheet.width * (1 - 1 / sheet.zoom));
    sheet.top = Math.min(Math.max(v - (v - sheet.top) * share, 0), sheet.height * (1 - 1 / sheet.zoom));
    draw();
  };
  const magnify = (sheet, event) => {
    const lens = element("lens"), [u, v] = fromEvent(sheet, event), context = lens.getContext("2d");
    sheet.at = [u, v];
    label(sheet);
    lens.hidden = !sheet.image;
    if (!sheet.image) return;
    // At the side of the cursor that has room.
    lens.style.left = `${event.clientX + (event.clientX + 200 < innerWidth ? 24 : -188)}px`;
    lens.style.top = `${event.clientY + (event.clientY + 200 < innerHeight ? 24 : -188)}px`;
    const share = sheet.image.naturalWidth / sheet.width;
    context.imageSmoothingEnabled = false;
    context.fillRect(0, 0, 160, 160);
    context.drawImage(sheet.image, (u + 0.5 - 10) * share, (v + 0.5 - 10) * share, 20 * share, 20 * share, 0, 0, 160, 160);
    context.strokeStyle = POINT;
    context.strokeRect(72, 72, 16, 16);
  };

  // ---- points ----

  const remember = () => { history.push(JSON.stringify({ points, active })); if (history.length > 200) history.shift(); };
  const undo = () => { if (history.length) { ({ points, active } = JSON.parse(history.pop())); draw(); } };
  const add = (z = 0, ground = null) => { points.push({ ground, z, pixels: {} }); active = points.length - 1; };
  const placeOf = (sheet, point) => (sheet.camera ? point.pixels[sheet.name] : point.ground && planPixel(point.ground));
  const nearest = (sheet, place) => {
    let found = -1, best = 8 / scaleOf(sheet);
    points.forEach((point, k) => {
      const own = placeOf(sheet, point), away = own && Math.hypot(own[0] - place[0], own[1] - place[1]);
      if (own && away < best) [best, found] = [away, k];
    });
    return found;
  };
  const snapped = (ground) => {
    const step = Number(element("snap").value);
    return step ? ground.map((one) => Math.round(one / step) * step) : ground;
  };
  const set = (sheet, place) => {
    if (sheet.camera) points[active].pixels[sheet.name] = place;
    else points[active].ground = snapped(planGround(place));
  };
  // The crossing of a view's grid that is nearest to a pixel.
  const crossing = (sheet, place) => {
    const ground = sheet.found && toGround(sheet.found, place), step = gridStep();
    return ground && ground.map((one) => Math.round(one / step) * step);
  };
  const enter = (name) => {
    if (active < 0) add();
    remember();
    const point = points[active], value = Number(element(name).value);
    if (name === "z") point.z = value;
    else point.ground = name === "x" ? [value, point.ground ? point.ground[1] : 0] : [point.ground ? point.ground[0] : 0, value];
    draw();
  };
  const press = (sheet, event) => {
    if (event.button !== 0) return;
    const place = fromEvent(sheet, event), near = nearest(sheet, place);
    sheet.canvas.focus();
    last = sheet;
    remember();
    if (near >= 0) active = near;
    else if (event.shiftKey && sheet.camera && sheet.found) {
      add(0, crossing(sheet, place));
      set(sheet, place);
    } else {
      if (active < 0) add();
      set(sheet, place);
    }
    const drag = (moved) => { set(sheet, fromEvent(sheet, moved)); draw(); };
    const drop = () => { removeEventListener("mousemove", drag); removeEventListener("mouseup", drop); };
    addEventListener("mousemove", drag);
    addEventListener("mouseup", drop);
    draw();
  };
  const keys = {
    n: () => { remember(); add(); },
    p: () => { if (active >= 0 && points[active].ground) { remember(); add(Number(element("pole").value) || 2, points[active].ground); } },
    Delete: () => { if (active >= 0) { remember(); points.splice(active, 1); active = Math.min(active, points.length - 1); } },
    "[": () => { active = Math.max(0, active - 1); },
    "]": () => { active = Math.min(points.length - 1, active + 1); },
  };
  const nudge = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  addEventListener("keydown", (event) => {
    if (event.target.tagName === "INPUT" || event.target.tagName === "TEXTAREA") return;
    if ((event.ctrlKey || event.metaKey) && event.key === "z") undo();
    else if (keys[event.key]) keys[event.key]();
    else if (nudge[event.key] && last && active >= 0 && placeOf(last, points[active])) {
      const step = event.shiftKey ? 1 : 0.25, own = placeOf(last, points[active]);
      remember();
      set(last, [own[0] + step * nudge[event.key][0], own[1] + step * nudge[event.key][1]]);
    } else return;
    event.preventDefault();
    draw();
  });

  // ---- drawing ----

  // A cross with words at its right, `below` pixels lower; with a pale border, for it lies on pictures of any colour.
  const cross = (context, [u, v], colour, words, below) => {
    context.font = "bold 13px system-ui";
    for (const [paint, width] of [["#ffffffd0", 5], [colour, 2]]) {
      context.strokeStyle = context.fillStyle = paint;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(u - 7, v); context.lineTo(u + 7, v); context.moveTo(u, v - 7); context.lineTo(u, v + 7);
      context.stroke();
      if (width > 2) context.strokeText(words, u + 7, v - 6 + below); else context.fillText(words, u + 7, v - 6 + below);
    }
  };
  const ring = (context, [u, v]) => {
    context.strokeStyle = HINT;
    context.lineWidth = 3;
    context.beginPath();
    context.arc(u, v, 11, 0, 7);
    context.stroke();
  };
  const gridLines = (sheet, map, inFront) => {
    const context = sheet.canvas.getContext("2d");
    context.strokeStyle = LINE;
    context.lineWidth = 1;
    const line = (from, to) => {
      context.beginPath();
      let open = false;
      for (let k = 0; k <= 60; k++) {
        const ground = [from[0] + (to[0] - from[0]) * k / 60, from[1] + (to[1] - from[1]) * k / 60];
        if (!inFront(ground)) { open = false; continue; }
        const [u, v] = toCanvas(sheet, map(ground));
        if (open) context.lineTo(u, v); else context.moveTo(u, v);
        open = true;
      }
      context.stroke();
    };
    const step = gridStep();
    for (let x = Math.ceil(x0 / step) * step; x <= x1 + 1e-9; x += step) line([x, y0], [x, y1]);
    for (let y = Math.ceil(y0 / step) * step; y <= y1 + 1e-9; y += step) line([x0, y], [x1, y]);
    if (sheet.camera) return;
    context.lineWidth = 2.5;
    if (x0 <= 0 && x1 >= 0) line([0, y0], [0, y1]);
    if (y0 <= 0 && y1 >= 0) line([x0, 0], [x1, 0]);
    context.fillStyle = QUIET;
    context.font = "11px system-ui, sans-serif";
    const write = (value, ground) => { const [u, v] = toCanvas(sheet, map(ground)); context.fillText(+value.toFixed(2), u + 3, v - 3); };
    const apart = step * [1, 2, 4, 10].find((n) => n * step * planScale * scaleOf(sheet) >= 34 || n === 10);
    for (let x = Math.ceil(x0 / apart) * apart; x <= x1 + 1e-9; x += apart) write(x, [x, y0]);
    for (let y = Math.ceil(y0 / apart) * apart; y <= y1 + 1e-9; y += apart) write(y, [x0, y]);
  };
  const gridStep = () => [0.5, 1, 2, 5, 10, 20].find((s) => Math.max(x1 - x0, y1 - y0) / s <= 20) || 50;
  // The caption: the place under the cursor, and how well the points agree.
  const label = (sheet) => {
    const ground = sheet.at && (sheet.camera ? sheet.found && toGround(sheet.found, sheet.at) : planGround(sheet.at));
    const place = ground ? `x ${ground[0].toFixed(2)}, y ${ground[1].toFixed(2)} m; ` : "";
    sheet.caption.textContent = `${sheet.name}: ${place}${sheet.words}`;
  };
  const draw = () => {
    arrange();
    const rows = [];
    const hints = [];
    for (const sheet of sheets.filter((one) => one.camera)) sheet.found = fit(sheet.camera);
    for (const sheet of sheets) {
      const { canvas } = sheet, width = canvas.clientWidth || 600;
      canvas.width = width;
      canvas.height = Math.round(width * sheet.height / sheet.width);
      const context = canvas.getContext("2d"), scale = scaleOf(sheet);
      context.fillStyle = sheet.camera ? "#1f232a" : "#ffffff";
      context.fillRect(0, 0, canvas.width, canvas.height);
      if (sheet.image && sheet.image.complete) {
        context.drawImage(sheet.image, -sheet.left * scale, -sheet.top * scale, sheet.width * scale, sheet.height * scale);
      }
      let words = sheet.camera ? "needs four points on the ground" : "the ground from above, metres";
      if (!sheet.camera) gridLines(sheet, planPixel, () => true);
      else if (sheet.found) {
        gridLines(sheet, (ground) => toPixel(sheet.found, ground), (ground) => ahead(sheet.found, ground));
        const misses = [];
        points.forEach((point, k) => {
          const pixel = point.pixels[sheet.name];
          if (!pixel || !point.ground || point.z) return;
          const shown = toPixel(sheet.found, point.ground), ground = toGround(sheet.found, pixel);
          const off = Math.hypot(shown[0] - pixel[0], shown[1] - pixel[1]);
          const apart = ground ? 100 * Math.hypot(ground[0] - point.ground[0], ground[1] - point.ground[1]) : NaN;
          misses.push(off);
          rows.push([k + 1, sheet.name, off.toFixed(2), apart.toFixed(1)]);
        });
        const root = Math.sqrt(misses.reduce((sum, off) => sum + off * off, 0) / misses.length);
        words = misses.length > 4 ? `${misses.length} points, off by ${root.toFixed(2)} px` : "4 points: a fifth checks them";
        sheet.hint = hint(sheet.camera, sheet.found);
        if (sheet.hint) { hints.push(sheet.hint); ring(context, toCanvas(sheet, toPixel(sheet.found, sheet.hint))); }
      }
      points.forEach((point, k) => {
        const own = placeOf(sheet, point);
        const below = point.z && !sheet.camera ? 20 : 0; // on the plan its foot has the same place
        if (own) cross(context, toCanvas(sheet, own), k === active ? POINT : DARK, `${k + 1}${point.z ? ` z ${point.z}` : ""}`, below);
      });
      sheet.words = words;
      label(sheet);
    }
    const plan = sheets.find((sheet) => !sheet.camera), context = plan.canvas.getContext("2d");
    for (const ground of hints) ring(context, toCanvas(plan, planPixel(ground)));
    element("residuals").replaceChildren(...rows.map((cells) => {
      const row = document.createElement("tr");
      row.append(...cells.map((cell) => { const td = document.createElement("td"); td.textContent = cell; return td; }));
      return row;
    }));
    const ground = active < 0 ? null : points[active].ground;
    for (const [name, value] of [["x", ground && ground[0]], ["y", ground && ground[1]], ["z", active < 0 ? null : points[active].z]]) {
      if (document.activeElement !== element(name)) element(name).value = value === null ? "" : +value.toFixed(4);
    }
    element("which").textContent = active < 0 ? "none" : `${active + 1} of ${points.length}`;
    const csv = text();
    element("csv").value = csv;
    element("save").href = `data:text/csv;charset=utf-8,${encodeURIComponent(csv)}`;
  };
  const text = () => ["camera,u,v,x,y,z", ...sheets.filter((sheet) => sheet.camera).flatMap((sheet) => points
    .filter((point) => point.ground && point.pixels[sheet.name])
    .map((point) => [sheet.name, ...point.pixels[sheet.name].map((p) => p.toFixed(2)),
      ...point.ground.map((p) => p.toFixed(4)), point.z].join(",")))].join("\n") + "\n";

  addSheet("plan", data.plan.width, data.plan.height, data.plan.image ? [data.plan.image] : [], null);
  for (const camera of data.cameras) addSheet(camera.name, camera.width, camera.height, camera.images, camera);
  for (const name of ["x", "y", "z"]) element(name).onchange = () => enter(name);
  element("moment").parentElement.hidden = data.cameras.every((camera) => camera.images.length < 2);
  element("moment").oninput = () => {
    for (const sheet of sheets) sheet.image = sheet.images[Math.min(element("moment").value, sheet.images.length - 1)] || null;
    draw();
  };
  element("new").onclick = () => { keys.n(); draw(); };
  element("raise").onclick = () => { keys.p(); draw(); };
  element("undo").onclick = undo;
  addEventListener("resize", draw);
  draw();
})();
