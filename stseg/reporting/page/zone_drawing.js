// Zones and lines that are drawn on the plan, corner by corner, and saved as GeoJSON for `stseg measure`.
"use strict";
const zoneDrawing = (canvas, redraw) => {
  const element = (id) => document.getElementById(id);
  const COLOURS = { zone: "#0b70d8", line: "#a33bb0" }, LEAST = { zone: 3, line: 2 };
  const shapes = [];
  let kind = "", corners = [], map = null;

  const inside = (corners, x, y) => corners.reduce((within, [ax, ay], k) => {
    const [bx, by] = corners[(k + 1) % corners.length];
    return (ay > y) !== (by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay) ? !within : within;
  }, false);

  const trace = (own, points, closed) => {
    const { pen, u, v } = map;
    pen.strokeStyle = COLOURS[own];
    pen.lineWidth = 2.5;
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(u(x), v(y)) : pen.moveTo(u(x), v(y))));
    if (closed) pen.closePath();
    pen.stroke();
    pen.fillStyle = COLOURS[own];
    pen.globalAlpha = 0.1;
    if (closed) pen.fill();
    pen.globalAlpha = 1;
  };

  // Draws all shapes on a plan, with the people who are in each zone at the moment.
  const draw = (plan, people) => {
    map = plan;
    shapes.forEach((shape) => {
      trace(shape.kind, shape.corners, shape.kind === "zone");
      const [x, y] = shape.corners[0], { pen } = map;
      const count = people.filter((one) => inside(shape.corners, one.x, one.y)).length;
      pen.fillStyle = COLOURS[shape.kind];
      pen.textAlign = "left";
      pen.fillText(shape.kind === "zone" ? `${shape.name}: ${count}` : shape.name, map.u(x) + 6, map.v(y) - 6);
    });
    if (!corners.length) return;
    trace(kind, corners, false);
    corners.forEach(([x, y]) => map.pen.fillRect(map.u(x) - 3, map.v(y) - 3, 6, 6));
  };

  const geojson = () => ({
    type: "FeatureCollection",
    features: shapes.map(({ kind, name, corners }) => ({
      type: "Feature",
      properties: { name },
      geometry: kind === "zone"
        ? { type: "Polygon", coordinates: [[...corners, corners[0]]] }
        : { type: "LineString", coordinates: corners },
    })),
  });

  const update = () => {
    const words = kind ? `click its corners on the plan; Enter ends it, Escape drops it` : "";
    element("drawing").textContent = words || shapes.map((shape) => shape.name).join(", ");
    element("save-areas").hidden = !shapes.length;
    element("save-areas").href = `data:application/geo+json;charset=utf-8,${encodeURIComponent(JSON.stringify(geojson()))}`;
    element("undo-area").hidden = !shapes.length && !kind;
    canvas.style.cursor = kind ? "crosshair" : "";
    redraw();
  };
  const free = (wanted) => {
    const taken = new Set(shapes.map((shape) => shape.name));
    let name = wanted;
    for (let k = 2; taken.has(name); k++) name = `${wanted} ${k}`;
    return name;
  };
  const begin = (wanted) => { kind = wanted; corners = []; update(); };
  const end = () => {
    if (kind && corners.length >= LEAST[kind]) {
      const given = element("area-name").value.trim().slice(0, 90);
      shapes.push({ kind, corners, name: free(given || `${kind} ${shapes.length + 1}`) });
      element("area-name").value = "";
    }
    kind = "";
    corners = [];
    update();
  };

  canvas.addEventListener("click", (event) => {
    if (!kind || !map) return;
    const box = canvas.getBoundingClientRect(), round = (metres) => Math.round(1000 * metres) / 1000;
    corners.push([round(map.x(event.clientX - box.left)), round(map.y(event.clientY - box.top))]);
    redraw();
  });
  canvas.addEventListener("dblclick", () => { corners.pop(); end(); });
  document.addEventListener("keydown", (event) => {
    if (!kind) return;
    if (event.key === "Enter") end();
    if (event.key === "Escape") { corners = []; end(); }
    if (event.key === "Backspace" && event.target === document.body) { corners.pop(); redraw(); }
  });
  element("draw-zone").onclick = () => begin("zone");
  element("draw-line").onclick = () => begin("line");
  element("undo-area").onclick = () => { if (kind) corners = []; else shapes.pop(); kind = ""; update(); };
  return { draw };
};
