//! Speed of the orientation filters: `cargo bench --bench orientation`. One core; throughput is in samples.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use std::hint::black_box;
use surefoot::estimation::orientation_filter::{InertialSamples, OrientationMethod, estimate};

/// Two minutes at 256 Hz.
const SAMPLES: usize = 30_720;

fn methods(criterion: &mut Criterion) {
    let wave = |i: usize, period: f64| (std::f64::consts::TAU * i as f64 / (256.0 * period)).sin();
    let time_ns: Vec<i64> = (0..SAMPLES as i64).map(|i| i * 3_906_250).collect();
    let rate: Vec<_> =
        (0..SAMPLES).map(|i| Vector3::new(2.0 * wave(i, 1.1), wave(i, 1.7), 3.0 * wave(i, 0.9))).collect();
    let acceleration: Vec<_> =
        (0..SAMPLES).map(|i| Vector3::new(3.0 * wave(i, 0.8), 9.81 + wave(i, 0.5), 4.0 * wave(i, 1.3))).collect();
    let samples = InertialSamples { time_ns: &time_ns, acceleration: &acceleration, angular_rate: &rate };
    let mut group = criterion.benchmark_group("samples");
    group.throughput(Throughput::Elements(SAMPLES as u64)).sample_size(20);
    for method in OrientationMethod::ALL {
        group.bench_function(BenchmarkId::from_parameter(method.name()), |b| {
            b.iter(|| estimate(method, black_box(&samples)).map(|e| e.earth_from_sensor.len()));
        });
    }
    group.finish();
}

criterion_group!(benches, methods);
criterion_main!(benches);
