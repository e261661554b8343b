// The page: the stories and Explore, the address, and keys.

import { Explore, isEmbedded } from "./explore.js";
import { ModelLibrary } from "./library.js";
import { startStories } from "./stories.js";

const data = JSON.parse(document.getElementById("data").textContent);
const library = new ModelLibrary(data);
const explore = new Explore(document.querySelector("main"), library);
const storyHost = document.getElementById("stories");

document.getElementById("version").textContent = data.version;
addEventListener("hashchange", ({ newURL }) => { // the state may have replaced the address since
  const { hash } = new URL(newURL);
  if (/^#[a-z]/.test(hash)) return; // a part of the page
  if (hash !== explore.link) explore.follow(hash);
});
addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary, a, [role=slider]")) return;
  const { top, bottom } = document.getElementById("stage").getBoundingClientRect();
  if (bottom < 0 || top > innerHeight) return; // the space bar scrolls
  event.preventDefault();
  document.getElementById("play").click();
});
storyHost?.addEventListener("click", (event) => { // in a page embedded in a report, a link would lead to the report
  const link = event.target.closest("a");
  if (!link || !isEmbedded) return;
  event.preventDefault();
  document.querySelector(link.getAttribute("href")).scrollIntoView();
});
globalThis.app = { library, runs: explore.runs, plots: explore.diagrams.plots, seek: (t) => explore.seek(t), state: () => explore.state }; // for tests and the console
if (storyHost) globalThis.app.stories = startStories(library, explore.follow(location.hash));
else await explore.follow(location.hash);
