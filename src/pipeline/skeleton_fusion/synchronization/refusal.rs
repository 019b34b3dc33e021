//! Why a unit's clock cannot be aligned with the camera's.

/// Why a unit's clock cannot be aligned with the camera's; the text is a sentence for a person.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Too few samples or frames.
    #[error("there are too few samples or frames to align the clocks: record for longer")]
    TooShort,
    /// A time span beyond all exercise.
    #[error("the time stamps span more than two hours: one of them is wrong, or the recording must be cut")]
    TooLong,
    /// A time stamp is not after the one before it.
    #[error("the time stamps do not increase: the clock stood still or ran backwards")]
    ClockRunsBackwards,
    /// Nothing was recorded by both at the same time.
    #[error("unit and camera did not record at the same time")]
    NoOverlap,
    /// The unit never moved.
    #[error("the unit never moved: begin the recording with five vertical jumps")]
    UnitStill,
    /// The camera saw nobody move.
    #[error("the camera saw no movement of the segment: begin the recording with five vertical jumps in full view")]
    CameraStill,
    /// The camera does not track the unit's segment, and no other unit moved with it.
    #[error("the camera does not track the unit's segment, and no aligned unit felt the same impacts")]
    NotTracked,
    /// Unit and camera show different movements.
    #[error("no movement is common to unit and camera: is the unit on the declared segment?")]
    NoSharedMovement,
    /// A movement repeats itself so evenly that several alignments are equally good.
    #[error(
        "the movement repeats itself: clocks {:.2} s and {:.2} s apart explain it equally well; begin with five \
         vertical jumps",
        lags_s[0], lags_s[1]
    )]
    Ambiguous {
        /// Two offsets, camera minus unit, that are equally good, seconds.
        lags_s: [f64; 2],
    },
    /// The parts of the recording contradict each other.
    #[error("the parts of the recording ask for different offsets: the clock jumped, or the unit moved on the segment")]
    Inconsistent,
    /// A drift beyond every clock.
    #[error("the clocks would drift apart by {drift_ppm:.0} ppm, which no clock does: the alignment is not believed")]
    ImplausibleDrift {
        /// The drift that was found, ppm.
        drift_ppm: f64,
    },
    /// The offset is too uncertain to be used.
    #[error("the offset is only known to ± {:.0} ms: more movement is needed", sd_s * 1e3)]
    Imprecise {
        /// Standard deviation of the offset, seconds.
        sd_s: f64,
    },
}
