// Looks up what the page already says: sliders choose a cell, whose words are shown.
"use strict";
for (const lookup of document.querySelectorAll(".lookup")) {
  const sliders = [...lookup.querySelectorAll("input")];
  const cells = [...lookup.querySelectorAll("[data-cell]")];
  const said = lookup.querySelector(".said");
  const show = () => {
    for (const slider of sliders) {
      const words = JSON.parse(slider.dataset.cells)[slider.value];
      slider.parentElement.querySelector("output").textContent = words;
      slider.setAttribute("aria-valuetext", words);
    }
    const chosen = sliders.map((slider) => slider.value).join();
    for (const cell of cells) {
      const isChosen = cell.dataset.cell === chosen;
      cell.classList.toggle("chosen", isChosen);
      if (!isChosen) continue;
      said.textContent = cell.querySelector("title").textContent;
      // In front of its neighbours, so that none covers its edge.
      cell.parentNode.append(cell);
    }
  };
  for (const slider of sliders) slider.oninput = show;
  for (const cell of cells) cell.onclick = () => {
    cell.dataset.cell.split(",").forEach((at, nth) => { sliders[nth].value = at; });
    show();
  };
  lookup.classList.add("live");
  show();
}
