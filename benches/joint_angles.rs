//! Speed of the joint-angle pipeline: `cargo bench --bench joint_angles`. One core; throughput is in frames.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Rotation3, Vector3};
use std::hint::black_box;
use surefoot::assessment::{JointAngleSettings, Method};
use surefoot::body::kinematics::{forward_kinematics, forward_kinematics_with_jacobian};
use surefoot::body::pose::{POSE_DIMENSION, PoseVector};
use surefoot::body::{Joint, Limb, Pose, Skeleton};
use surefoot::estimation::particle_filter::{ParticleModel, Particles};
use surefoot::pipeline::joint_angles::assess;
use surefoot::pipeline::joint_angles::noise_model::NoiseModel;
use surefoot::pipeline::joint_angles::particle_model::SkeletonParticleModel;
use surefoot::progress::Monitor;
use surefoot::recording::{Recording, SkeletonRecording};

const FRAMES: usize = 600;

/// Knees, hips and elbows swing once in two seconds after a second of rest.
fn posture(t: usize) -> PoseVector {
    let phase = (t as f64 / 30.0 - 1.0).max(0.0) * std::f64::consts::PI;
    let swing = 0.5 * (1.0 - phase.cos());
    PoseVector::from_fn(|i, _| match i {
        11 | 14 => 0.6 * swing,
        15..POSE_DIMENSION => 0.9 * swing,
        _ => 0.05 * swing,
    })
}

/// A recording of these postures with a tremor of some millimetres.
fn recording() -> Recording {
    let skeleton = Skeleton::of_stature(1.7);
    let mut joints: Vec<Joint> = Limb::ALL.iter().flat_map(|l| l.joints().map(|(joint, _)| joint)).collect();
    joints.push(Joint::Torso);
    let tremor = |k: usize| 0.004 * ((k * 7919 % 1000) as f64 / 500.0 - 1.0);
    let mut positions = Vec::new();
    for t in 0..FRAMES {
        let points = forward_kinematics(&skeleton, &Pose::from_vector(&posture(t)));
        positions.extend(points.iter().enumerate().map(|(p, point)| point + Vector3::repeat(tremor(13 * t + p))));
        positions.push(Vector3::zeros());
    }
    let skeleton = SkeletonRecording {
        confidence: vec![1.0; positions.len()],
        time_ns: (0..FRAMES as i64).map(|t| t * 33_333_333).collect(),
        joints,
        positions,
        orientations: Vec::new(),
    };
    Recording { skeleton: Some(skeleton), ..Recording::default() }
}

fn kernels(criterion: &mut Criterion) {
    let skeleton = Skeleton::of_stature(1.7);
    let pose = Pose::from_vector(&posture(45));
    let points = forward_kinematics(&skeleton, &pose);
    let mut group = criterion.benchmark_group("kernel");
    group.bench_function("forward_kinematics", |b| b.iter(|| forward_kinematics(black_box(&skeleton), &pose)));
    group.bench_function("forward_kinematics_with_jacobian", |b| {
        b.iter(|| forward_kinematics_with_jacobian(black_box(&skeleton), &pose));
    });
    let mut model = SkeletonParticleModel::new(&skeleton, NoiseModel::nite_table1(), &Rotation3::identity());
    let particles = Particles::at(posture(45).as_slice(), 512);
    let mut log_likelihood = vec![0.0f32; 512];
    group.throughput(Throughput::Elements(512));
    group.bench_function("forward_kinematics_and_likelihood_of_512_particles", |b| {
        b.iter(|| model.log_likelihood(black_box(&points), &particles, &mut log_likelihood));
    });
    group.finish();
}

fn methods(criterion: &mut Criterion) {
    let recording = recording();
    let monitor = Monitor::default();
    let mut group = criterion.benchmark_group("frames");
    group.throughput(Throughput::Elements(FRAMES as u64)).sample_size(10);
    let particle = [128, 512, 2048].map(|particles| (Method::Particle, Some(particles)));
    let others = Method::ALL.into_iter().filter(|m| !matches!(m, Method::Particle | Method::Nite));
    for (method, particles) in particle.into_iter().chain(others.map(|method| (method, None))) {
        let settings = JointAngleSettings { method, particles, ..JointAngleSettings::default() };
        let name = match method.has_particles() {
            true => format!("{method}/{}", settings.chosen_particles()),
            false => method.name().to_owned(),
        };
        group.bench_function(BenchmarkId::from_parameter(name), |b| {
            b.iter(|| assess(&recording, &settings, &monitor).map(|a| a.summary.len()));
        });
    }
    group.finish();
}

criterion_group!(benches, kernels, methods);
criterion_main!(benches);
