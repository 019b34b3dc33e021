//! Durable jobs: enqueue, claim, finish.
