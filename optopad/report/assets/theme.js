// Light or dark: by the reader's system, or by the reader's choice on the page.
const optopadTheme = (() => {
"use strict";
const root = document.documentElement, system = window.matchMedia("(prefers-color-scheme: dark)"), heard = [];
const KEY = "optopad-theme", CHOICES = ["auto", "light", "dark"];
const kept = () => { try { return localStorage.getItem(KEY); } catch (refused) { return null; } };
const keep = (choice) => { try { localStorage.setItem(KEY, choice); } catch (refused) { /* not kept: the page works without */ } };
let choice = CHOICES.includes(kept()) ? kept() : "auto";

const isDark = () => choice === "dark" || (choice === "auto" && system.matches);
function apply() {
  root.dataset.theme = isDark() ? "dark" : "light";
  const control = document.getElementById("theme");
  if (control) control.value = choice;
  for (const listener of heard) listener();
}

system.addEventListener("change", apply);
document.addEventListener("change", (event) => {
  if (event.target.id !== "theme") return;
  choice = event.target.value;
  keep(choice);
  apply();
});
const control = document.getElementById("theme");
if (control) control.closest("label").hidden = false;
apply();
return {isDark, onChange: (listener) => heard.push(listener)};
})();

// Long sheets are folded on the screen and open in print.
(() => {
"use strict";
const folds = [...document.querySelectorAll("details.sheet")];
for (const fold of folds) fold.open = false;
let opened = [];
window.addEventListener("beforeprint", () => { opened = folds.filter((fold) => !fold.open); for (const fold of opened) fold.open = true; });
window.addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });
})();
