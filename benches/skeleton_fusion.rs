//! Fusion of ten minutes of a camera and nine units on one core.

use criterion::{Criterion, criterion_group, criterion_main};
use surefoot::assessment::SkeletonFusionSettings;
use surefoot::body::Side;
use surefoot::pipeline::skeleton_fusion;
use surefoot::progress::Monitor;
use surefoot::synthetic::inertial::FusionSimulation;
use surefoot::synthetic::movement::Movement;
use surefoot::synthetic::simulate_fusion;

fn ten_minutes(criterion: &mut Criterion) {
    let simulation = FusionSimulation { movement_s: 570.0, ..FusionSimulation::new(Movement::Kick(Side::Right), 1) };
    let recording = simulate_fusion(&simulation).expect("settings within their ranges").recording;
    let settings = SkeletonFusionSettings::default();
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut group = criterion.benchmark_group("skeleton_fusion");
    group.sample_size(10);
    group.bench_function("nine units at 256 Hz, ten minutes", |bencher| {
        bencher.iter(|| {
            let assess = || skeleton_fusion::assess(&recording, &settings, &Monitor::default());
            one_core.install(assess).expect("an assessment")
        });
    });
    group.finish();
}

criterion_group!(benches, ten_minutes);
criterion_main!(benches);
