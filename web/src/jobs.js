// The state of work on recordings, as it goes on.
import { read } from "./api.js";

const STEPS = {
  waiting: "waiting",
  decoding: "reading the recording",
  calibrating: "measuring the body",
  estimating: "estimating",
  smoothing: "going back over it",
  summarizing: "summing up",
  saving: "storing",
};

/** Follows every job and every recording of the page whose work is not over. */
export function watchJobs() {
  for (const place of document.querySelectorAll("[data-job]")) follow(place, place.dataset.job);
  for (const place of document.querySelectorAll("[data-recording]")) {
    read(`/v1/jobs?limit=1&recording_id=${encodeURIComponent(place.dataset.recording)}`)
      .then((page) => page.items[0] && follow(place, page.items[0].id))
      .catch(() => {});
  }
}

function follow(place, id) {
  const events = new EventSource(`/v1/jobs/${encodeURIComponent(id)}/events`);
  events.addEventListener("job", (event) => {
    const job = JSON.parse(event.data);
    show(place, job);
    if (["done", "failed", "cancelled"].includes(job.state)) events.close();
  });
}

function show(place, job) {
  const before = place.dataset.state;
  place.dataset.state = job.state;
  place.className = `job ${job.state}`;
  const { step, done, total } = job.progress;
  let text = job.state;
  if (job.state === "running") {
    text += `: ${STEPS[step] ?? step}`;
    // Tenths are enough to see it move, and do not make a reader of the page talk without end.
    if (total > 0) text += `, ${10 * Math.floor((10 * done) / total)} %`;
  }
  if (job.state === "failed" && job.error) text += `: ${job.error.sentence}`;
  if (place.textContent !== text) place.textContent = text;
  if (job.state === "done" && job.assessment_id && before !== "done") {
    const link = document.createElement("a");
    link.href = `/app/assessments/${job.assessment_id}`;
    link.textContent = "Open the assessment";
    place.after(" ", link);
  }
}
