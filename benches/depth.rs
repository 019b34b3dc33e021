//! Depth images: bytes per image and images per second of each coding, and through the whole recording.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::io::Cursor;
use surefoot::recording::depth::{DepthCoding, DepthDecoder, DepthEncoder, DepthImage, DepthReader, DepthUnit};
use surefoot::recording::{Format, Inspector, Limits};
use surefoot::synthetic::walker::{Course, WalkerSettings, WalkerSimulation, trousers};

/// Images of the simulated walk, a second apart, so that they differ.
const IMAGES: usize = 20;

fn simulation() -> WalkerSimulation {
    let mut settings = WalkerSettings::of_seed(Course::Straight, 3);
    (settings.duration_s, settings.rate_hz) = (IMAGES as f64, 1.0);
    WalkerSimulation::new(&settings, trousers::trousers()).expect("sound settings")
}

fn codings(criterion: &mut Criterion) {
    let images: Vec<DepthImage> = simulation().frames().map(|frame| frame.image).collect();
    let mut group = criterion.benchmark_group("depth images");
    group.throughput(Throughput::Elements(images.len() as u64)).sample_size(20);
    for coding in [DepthCoding::None, DepthCoding::Zstd, DepthCoding::RunsZstd] {
        let mut encoder = DepthEncoder::new(coding).expect("zstd");
        let messages: Vec<Vec<u8>> =
            images.iter().map(|image| encoder.encode(image).expect("an image").to_owned()).collect();
        let bytes: usize = messages.iter().map(Vec::len).sum();
        println!("{coding:?}: {:.1} kB per image", bytes as f64 / 1e3 / images.len() as f64);
        group.bench_function(format!("encode {coding:?}"), |bencher| {
            bencher.iter(|| images.iter().map(|image| encoder.encode(image).map_or(0, <[u8]>::len)).sum::<usize>());
        });
        let mut decoder = DepthDecoder::default();
        let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
        group.bench_function(format!("decode {coding:?}"), |bencher| {
            bencher.iter(|| {
                for message in &messages {
                    decoder.decode_into(message, &mut image).expect("an image");
                }
                black_box(image.values[0])
            });
        });
    }
    group.finish();
}

fn recordings(criterion: &mut Criterion) {
    let bytes = simulation().write(Cursor::new(Vec::new()), |_| ()).expect("a recording").into_inner();
    let mut group = criterion.benchmark_group("depth recording");
    group.throughput(Throughput::Elements(IMAGES as u64)).sample_size(20);
    group.bench_function("inspect", |bencher| {
        bencher.iter(|| {
            let mut inspector = Inspector::new(Format::Mcap, &Limits::default());
            inspector.push(&bytes).expect("sound");
            inspector.finish().expect("sound")
        });
    });
    group.bench_function("read", |bencher| {
        let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
        bencher.iter(|| {
            let mut reader = DepthReader::open(&bytes[..], &Limits::default()).expect("sound");
            while reader.next_into(&mut image).expect("sound").is_some() {}
        });
    });
    group.finish();
}

criterion_group!(benches, codings, recordings);
criterion_main!(benches);
