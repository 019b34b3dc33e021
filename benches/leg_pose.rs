//! Speed of the paper's leg tracker: `cargo bench --bench leg_pose`. Frames of 640 × 480 with about 55 000 pixels of legs.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use rayon::ThreadPoolBuilder;
use std::hint::black_box;
use surefoot::assessment::LegCues;
use surefoot::body::legs::LegState;
use surefoot::body::legs::constraints::stand;
use surefoot::estimation::particle_filter::{ParticleModel, Particles};
use surefoot::estimation::random::RandomStreams;
use surefoot::geometry::camera::{DepthMap, Intrinsics};
use surefoot::geometry::floor::Floor;
use surefoot::geometry::lanes::LANES;
use surefoot::pipeline::leg_pose::foreground::Region;
use surefoot::pipeline::leg_pose::paper::model::{LegParticleModel, Observation, PARTICLE_DIMENSION};
use surefoot::pipeline::leg_pose::paper::render::render;
use surefoot::pipeline::leg_pose::paper::{PaperSettings, Tracker, TransitionNoise};

const CAMERA: Intrinsics = Intrinsics { fx: 585.0, fy: 585.0, cx: 319.5, cy: 239.5 };
const REGION: Region = Region { depth: [0.0, 1.8], x: [-0.4, 0.4] };
const SIZE: (usize, usize) = (640, 480);

/// Two legs in the middle of a step, 1.1 m before the camera.
fn scene() -> (Floor, LegState, DepthMap) {
    let floor = Floor::under_camera(0.75, 0.3);
    let mut state = LegState::upright(1.7, Vector3::new(-0.11, -0.1, 1.06));
    state.hip_distance = 0.2;
    state.angles[0].hip[0] = 0.35;
    state.angles[0].knee = 0.2;
    state.angles[1].hip[0] = -0.15;
    state.angles[1].knee = 0.3;
    let (state, _, solids) = stand(&state, &floor);
    (floor, state, render(&solids, &CAMERA, SIZE.0, SIZE.1))
}

fn tracker(particles: usize, cues: LegCues, floor: Floor) -> Tracker {
    let settings = PaperSettings { particles, cues, region: REGION, ..PaperSettings::default() };
    Tracker::new(settings, CAMERA, floor, DepthMap::empty(SIZE.0, SIZE.1))
}

/// Whole frames: foreground, transition, both cues, resampling, estimate.
fn frames(criterion: &mut Criterion) {
    let (floor, _, image) = scene();
    let mut group = criterion.benchmark_group("leg_pose/frame");
    group.sample_size(10).throughput(Throughput::Elements(1));
    for (particles, cues, threads) in [
        (5000, LegCues::Both, 1),
        (5000, LegCues::Both, 2),
        (5000, LegCues::Distance, 2),
        (5000, LegCues::Projection, 2),
        (2500, LegCues::Both, 2),
        (10_000, LegCues::Both, 2),
    ] {
        let Ok(pool) = ThreadPoolBuilder::new().num_threads(threads).build() else { continue };
        let mut tracker = tracker(particles, cues, floor);
        let pixels = tracker.foreground(&image).map_or(0, |foreground| foreground.pixels);
        let mut time_ns = 0;
        let mut step = || {
            time_ns += 33_333_333;
            pool.install(|| tracker.step(time_ns, black_box(&image)).map(|estimate| estimate.effective_sample_size))
        };
        // The first frame searches.
        let _ = step();
        let name = format!("{particles} particles, {}, {pixels} pixels, {threads} threads", cues.name());
        group.bench_function(BenchmarkId::from_parameter(name), |b| b.iter(&mut step));
    }
    group.finish();
}

/// Both cues on AVX2 alone is what a machine without AVX-512 has: the weighing of 512 particles, one thread.
fn weighing(criterion: &mut Criterion) {
    const COUNT: usize = 32 * LANES;
    let (floor, state, image) = scene();
    let Ok(foreground) = tracker(COUNT, LegCues::Both, floor).foreground(&image) else { return };
    let Some(observation) = Observation::new(foreground, CAMERA) else { return };
    let mut start = state.to_vector().as_slice().to_vec();
    start.resize(PARTICLE_DIMENSION, 0.0);
    let mut particles = Particles::at(&start, COUNT);
    let Ok(pool) = ThreadPoolBuilder::new().num_threads(1).build() else { return };
    let mut group = criterion.benchmark_group("leg_pose/weigh");
    group.sample_size(20).throughput(Throughput::Elements(COUNT as u64));
    for (name, arch) in instruction_sets() {
        for cues in [LegCues::Distance, LegCues::Projection, LegCues::Both] {
            let mut model = LegParticleModel::new(floor, cues, &TransitionNoise::default()).with_arch(arch);
            model.propagate(1.0 / 30.0, &mut RandomStreams::new(1), &mut particles);
            let mut logs = vec![0.0; COUNT];
            group.bench_function(BenchmarkId::new(name, cues.name()), |b| {
                b.iter(|| pool.install(|| model.log_likelihood(black_box(&observation), &particles, &mut logs)));
            });
        }
    }
    group.finish();
}

/// The widest instruction set of this machine and, where there is one, AVX2 beside it.
fn instruction_sets() -> Vec<(&'static str, pulp::Arch)> {
    let mut sets = vec![("widest", pulp::Arch::new())];
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        sets.push(("avx2", pulp::Arch::V3(avx2)));
    }
    sets
}

criterion_group!(benches, frames, weighing);
criterion_main!(benches);
