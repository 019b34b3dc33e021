//! The worker: claim a job, load its recording, assess, save.
