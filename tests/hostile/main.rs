//! A mutation fuzzer for everything that reads bytes from outside: no panic, no endless work, whatever comes.
//!
//! Sound seeds are changed at random, deterministically by seed and number, and given to a decoder. What was once found is kept
//! under `found/DECODER/` and tried first. `SUREFOOT_FUZZ_INPUTS` sets how many inputs each decoder gets, `SUREFOOT_SEED` which.
//! The long run: `SUREFOOT_FUZZ_INPUTS=1700000 cargo test --release --test hostile -- --nocapture --test-threads 1`

#![expect(clippy::unwrap_used, reason = "all of this crate is tests; helpers of tests fail by panic too")]

mod decoders;
mod mutation;

use decoders::{DECODERS, Decoder};
use mutation::mutated;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// An input that takes longer is a finding: seeds take milliseconds.
const LONGEST: Duration = Duration::from_secs(10);

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().map_or(default, |text| text.parse().expect("a number"))
}

fn found_folder(decoder: &Decoder) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/found").join(decoder.name)
}

/// What went wrong with an input, if anything did.
fn complaint(decoder: &Decoder, input: &[u8]) -> Option<String> {
    let begun = Instant::now();
    if catch_unwind(AssertUnwindSafe(|| (decoder.read)(input))).is_err() {
        return Some("panic".to_owned());
    }
    let took = begun.elapsed();
    (took > LONGEST).then(|| format!("took {:.1} s", took.as_secs_f64()))
}

#[test]
fn what_was_found_before_stays_mended() {
    for decoder in DECODERS {
        for entry in fs::read_dir(found_folder(decoder)).into_iter().flatten() {
            let path = entry.unwrap().path();
            let complaint = complaint(decoder, &fs::read(&path).unwrap());
            assert_eq!(complaint, None, "{}", path.display());
        }
    }
}

#[test]
fn no_input_makes_a_decoder_panic_or_hang() {
    let (n, seed) = (number("SUREFOOT_FUZZ_INPUTS", 1500), number("SUREFOOT_SEED", 1));
    let mut findings = Vec::new();
    let mut n_all = 0;
    for (stream, decoder) in DECODERS.iter().enumerate() {
        let n = n.div_ceil(decoder.cost);
        let seeds = (decoder.seeds)();
        assert!(seeds.iter().all(|sound| (decoder.read)(sound)), "{}: a seed is refused", decoder.name);
        let (begun, n_accepted) = (Instant::now(), AtomicU64::new(0));
        let found: Vec<_> = (0..n)
            .into_par_iter()
            .filter_map(|i| {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(((stream as u64) << 40) | i);
                let input = mutated(&seeds, decoder.shape, &mut random);
                if catch_unwind(AssertUnwindSafe(|| (decoder.read)(&input))).is_ok_and(|is_accepted| is_accepted) {
                    n_accepted.fetch_add(1, Ordering::Relaxed);
                    return None;
                }
                complaint(decoder, &input).map(|complaint| (i, complaint, input))
            })
            .collect();
        n_all += n;
        println!(
            "{}: {n} inputs, {} accepted, {} findings, {:.1} s",
            decoder.name,
            n_accepted.into_inner(),
            found.len(),
            begun.elapsed().as_secs_f64()
        );
        // One of each kind is enough to keep.
        for (i, complaint, input) in found.into_iter().take(5) {
            let folder = found_folder(decoder);
            fs::create_dir_all(&folder).unwrap();
            let path = folder.join(format!("{seed}-{i}"));
            fs::write(&path, input).unwrap();
            findings.push(format!("{}: {complaint}", path.display()));
        }
    }
    println!("{n_all} inputs in all (seed {seed}), {} findings", findings.len());
    assert!(findings.is_empty(), "{findings:#?}");
}
