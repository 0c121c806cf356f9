// One question after the other; one key answers. The answers are a small CSV. The plan plays the seconds around.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent), questions = data.questions;
  const element = (id) => document.getElementById(id);
  const [x0, x1] = data.x, [y0, y1] = data.y, TRAIL = 12;
  const answers = new Array(questions.length).fill(null);
  let at = 0, moment = 0, timer = 0;

  const text = () => ["action,frame,id,other,name", ...answers.filter((line) => line)].join("\n") + "\n";
  const show = () => {
    const item = questions[at];
    document.querySelectorAll(".item").forEach((one, k) => { one.hidden = k !== at; });
    element("count").textContent = questions.length ? `${at + 1} of ${questions.length}` : "nothing is doubtful";
    element("question").textContent = item ? item.text : "";
    element("plan").hidden = element("time").hidden = !item;
    element("choices").replaceChildren(...(item ? item.choices : []).map(([key, words, line]) => {
      const button = document.createElement("button");
      button.textContent = `${key}: ${words}`;
      button.dataset.key = key;
      if (answers[at] === line) button.className = "chosen";
      button.onclick = () => answer(key);
      return button;
    }));
    element("csv").value = text();
    element("save").href = `data:text/csv;charset=utf-8,${encodeURIComponent(text())}`;
    if (item) draw();
  };
  const go = (next) => {
    at = Math.min(Math.max(next, 0), Math.max(questions.length - 1, 0));
    moment = questions.length ? Math.min(questions[at].film.start, questions[at].film.clock.length - 1) : 0;
    show();
  };
  const answer = (key) => {
    const choice = questions[at] && questions[at].choices.find((one) => one[0] === key);
    if (!choice) return;
    answers[at] = choice[2];
    go(at + 1);
  };

  // ---- the plan ----

  const draw = () => {
    const { clock, tracks } = questions[at].film, canvas = element("plan"), pen = canvas.getContext("2d");
    const tallest = Math.max(240, 0.6 * innerHeight - 40), ratio = window.devicePixelRatio || 1;
    const scale = Math.min(((canvas.parentElement.clientWidth || 560) - 42) / (x1 - x0), tallest / (y1 - y0));
    const width = scale * (x1 - x0) + 42, height = scale * (y1 - y0) + 36;
    const u = (x) => 30 + (x - x0) * scale, v = (y) => 12 + (y1 - y) * scale;
    canvas.style.width = element("time").style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    pen.scale(ratio, ratio);
    const line = (places, colour, wide) => {
      pen.beginPath();
      places.forEach(([x, y], k) => (k ? pen.lineTo(u(x), v(y)) : pen.moveTo(u(x), v(y))));
      [pen.strokeStyle, pen.lineWidth] = [colour, wide];
      pen.stroke();
    };
    const step = [1, 2, 5, 10, 20, 50, 100].find((one) => one * scale > 24) || 200;
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = "#8a9099";
    pen.textAlign = "center";
    for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
      line([[x, y0], [x, y1]], "#e4e6ea", 1);
      pen.fillText(x, u(x), v(y0) + 17);
    }
    pen.textAlign = "right";
    for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
      line([[x0, y], [x1, y]], "#e4e6ea", 1);
      pen.fillText(y, 24, v(y) + 4);
    }
    pen.textAlign = "left";
    const border = data.polygon || [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    line([...border, border[0]], "#2a2e34", 1);
    pen.font = "bold 13px system-ui, sans-serif";
    for (const track of tracks) {
      const own = track.place.filter((_, k) => track.moment[k] <= moment && track.moment[k] > moment - TRAIL);
      line(own, track.colour, 3);
      const now = track.place[track.moment.indexOf(moment)];
      if (!now) continue;
      pen.fillStyle = track.colour;
      pen.beginPath();
      pen.arc(u(now[0]), v(now[1]), 7, 0, 7);
      pen.fill();
      pen.fillText(track.id, u(now[0]) + 9, v(now[1]) - 7);
    }
    [element("slider").max, element("slider").value] = [clock.length - 1, moment];
    element("clock").textContent = clock[moment];
  };
  const play = () => {
    const length = questions[at] ? questions[at].film.clock.length : 0;
    if (timer || !length) { clearInterval(timer); timer = 0; return; }
    if (moment === length - 1) moment = 0;
    timer = setInterval(() => {
      moment = Math.min(moment + 1, questions[at].film.clock.length - 1);
      draw();
      if (moment === questions[at].film.clock.length - 1) play();
    }, 100);
  };
  element("slider").oninput = () => { moment = Number(element("slider").value); draw(); };
  addEventListener("resize", show);
  addEventListener("keydown", (event) => {
    if (event.target.tagName === "TEXTAREA") return;
    if (event.key === "ArrowLeft" && event.target.id !== "slider") go(at - 1);
    else if (event.key === "ArrowRight" && event.target.id !== "slider") go(at + 1);
    else if (event.key === "Backspace") { answers[at] = null; show(); }
    else if (event.key === " ") play();
    else { answer(event.key); return; }
    event.preventDefault();
  });
  go(0);
})();
