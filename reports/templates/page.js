"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const own = ["error", "input", "tube", "region"];
  const config = { responsive: true, displaylogo: false, scrollZoom: false };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // The layout in the colours of the page.
  function themed(layout) {
    const result = { ...layout, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)" };
    result.font = { color: colour("--text"), size: 13 };
    for (const axis of ["xaxis", "yaxis"]) {
      result[axis] = { gridcolor: colour("--grid"), zerolinecolor: colour("--line"), automargin: true, ...layout[axis] };
    }
    return result;
  }

  function draw(name, figure) {
    const place = document.getElementById(name);
    if (!place) return;
    const frame = document.getElementById(name + "-figure");
    if (frame) frame.hidden = !figure;
    if (figure) Plotly.react(place, figure.data, themed(figure.layout), config);
  }

  const choice = document.getElementById("agent");

  function drawAll() {
    draw("network", figures.network);
    const charts = choice ? figures.agents[choice.value] : {};
    for (const name of own) draw(name, charts[name]);
  }

  if (choice) choice.addEventListener("change", drawAll);
  dark.addEventListener("change", drawAll);
  drawAll();
})();
