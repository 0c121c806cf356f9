// One question after the other; one key answers. The answers are a small CSV.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const element = (id) => document.getElementById(id);
  const answers = new Array(data.length).fill("");
  let at = 0;
  const text = () => ["action,frame,id,other,name", ...answers.filter((line) => line)].join("\n") + "\n";
  const show = () => {
    const item = data[at];
    document.querySelectorAll(".item").forEach((one, k) => { one.hidden = k !== at; });
    element("count").textContent = data.length ? `${at + 1} of ${data.length}` : "nothing is doubtful";
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
  };
  const answer = (key) => {
    const choice = data[at] && data[at].choices.find((one) => one[0] === key);
    if (!choice) return;
    answers[at] = choice[2];
    at = Math.min(at + 1, data.length - 1);
    show();
  };
  addEventListener("keydown", (event) => {
    if (event.target.tagName === "TEXTAREA") return;
    if (event.key === "ArrowLeft") at = Math.max(0, at - 1);
    else if (event.key === "ArrowRight") at = Math.min(data.length - 1, at + 1);
    else if (event.key === "Backspace") answers[at] = "";
    else { answer(event.key); return; }
    event.preventDefault();
    show();
  });
  show();
})();
