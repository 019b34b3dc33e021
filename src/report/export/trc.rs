//! Joint places as an OpenSim marker file, millimetres in the sensor's frame with y up.

use super::Export;
use crate::assessment::JointTrack;
use std::fmt::Write;
use std::ops::Range;

/// Millimetres in a metre.
const MM_PER_M: f32 = 1000.0;

/// A marker file; a joint that was lost stays empty.
pub fn trc(track: JointTrack) -> Export {
    let (n, joints) = (track.len(), track.joints.len());
    let span_s = match (track.time_ns.first(), track.time_ns.last()) {
        (Some(first), Some(last)) => (last - first) as f64 * 1e-9,
        _ => 0.0,
    };
    let rate = if span_s > 0.0 { (n - 1) as f64 / span_s } else { 0.0 };
    let mut head = String::from("PathFileType\t4\t(X/Y/Z)\tsurefoot.trc\n");
    head.push_str(
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n",
    );
    let _ = writeln!(head, "{rate:.3}\t{rate:.3}\t{n}\t{joints}\tmm\t{rate:.3}\t1\t{n}");
    head.push_str("Frame#\tTime");
    for joint in &track.joints {
        let _ = write!(head, "\t{}\t\t", joint.name());
    }
    head.push_str("\n\t");
    for number in 1..=joints {
        let _ = write!(head, "\tX{number}\tY{number}\tZ{number}");
    }
    head.push_str("\n\n");
    Export::new(head, n, move |range| rows(&track, range))
}

fn rows(track: &JointTrack, range: Range<usize>) -> String {
    let mut text = String::with_capacity(range.len() * track.joints.len() * 30);
    for t in range {
        let seconds = (track.time_ns[t] - track.time_ns[0]) as f64 * 1e-9;
        let _ = write!(text, "{}\t{seconds:.6}", t + 1);
        for value in track.frame(t).iter().flatten() {
            text.push('\t');
            if value.is_finite() {
                let _ = write!(text, "{:.3}", value * MM_PER_M);
            }
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Joint;

    #[test]
    fn places_are_millimetres_and_a_lost_joint_stays_empty() {
        let track = JointTrack {
            joints: vec![Joint::Head, Joint::Pelvis],
            time_ns: vec![0, 50_000_000],
            positions_m: vec![[0.0, 1.5, 2.0], [0.0, 1.0, 2.0], [0.1, 1.5, 2.0], [f32::NAN; 3]],
        };
        let text: String = trc(track).pieces().collect();
        let rows: Vec<&str> = text.lines().collect();
        assert!(rows[2].starts_with("20.000\t20.000\t2\t2\tmm"));
        assert_eq!(rows[6], "1\t0.000000\t0.000\t1500.000\t2000.000\t0.000\t1000.000\t2000.000");
        assert_eq!(rows[7], "2\t0.050000\t100.000\t1500.000\t2000.000\t\t\t");
    }
}
