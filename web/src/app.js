// The script of the clinician's pages. Everything it adds is an enhancement: the pages read and print without it.
import { watchJobs } from "./jobs.js";
import { openViewers } from "./viewer.js";

for (const button of document.querySelectorAll("[data-print]")) {
  button.hidden = false;
  button.addEventListener("click", () => window.print());
}
watchJobs();
openViewers();
document.documentElement.dataset.ready = performance.now().toFixed(0);
