//! Where joints were in a recording that was assessed.

use super::database::{Row, Transaction, query};
use super::series::codec::{Decoder, Encoder};
use super::{Access, AssessmentId, StorageError, Store, row};
use crate::assessment::JointTrack;
use crate::body::Joint;
use tokio::task::spawn_blocking;

/// Most values of a track that is read: five hours of 25 joints at 60 frames a second.
const MOST_VALUES: usize = 100_000_000;

/// A track in the form in which it is inserted: column by column, which compresses better than frame by frame.
#[derive(Debug)]
pub(super) struct EncodedTrack {
    joints: String,
    n_frames: i64,
    time: Vec<u8>,
    positions: Vec<u8>,
}

impl EncodedTrack {
    /// Codes a track.
    pub(super) fn encode(track: &JointTrack) -> Result<Self, StorageError> {
        let columns = 3 * track.joints.len();
        if track.positions_m.len() != track.len() * track.joints.len() {
            return Err(StorageError::Corrupt("the positions of joints are not as many as their times".into()));
        }
        let n_joints = track.joints.len();
        let column = |c: usize| track.positions_m.iter().skip(c / 3).step_by(n_joints.max(1)).map(move |p| p[c % 3]);
        let values: Vec<f32> = (0..columns).flat_map(column).collect();
        let mut encoder = Encoder::new()?;
        Ok(Self {
            joints: row::readable_json("the joints", &track.joints)?,
            n_frames: track.len() as i64,
            time: encoder.encode_times(&track.time_ns)?,
            positions: encoder.encode_floats(&values)?,
        })
    }
}

/// Inserts a track inside the caller's transaction.
pub(super) async fn insert(
    connection: &mut Transaction,
    id: AssessmentId,
    encoded: &EncodedTrack,
) -> Result<(), StorageError> {
    query("INSERT INTO joint_tracks (assessment_id, joints, n_frames, time, positions) VALUES ($1, $2, $3, $4, $5)")
        .bind(id)
        .bind(&encoded.joints)
        .bind(encoded.n_frames)
        .bind(&encoded.time)
        .bind(&encoded.positions)
        .execute(connection)
        .await?;
    Ok(())
}

impl Store {
    /// Where joints were in the recording of an assessment within the caller's reach; none when it shows no skeleton.
    ///
    /// # Errors
    /// `NotFound` when there is no such assessment; `Corrupt` when what is stored is damaged.
    pub async fn joints_of_assessment(
        &self,
        access: &Access,
        id: AssessmentId,
    ) -> Result<Option<JointTrack>, StorageError> {
        self.channels_of_assessment(access, id).await?;
        let row = query("SELECT joints, n_frames, time, positions FROM joint_tracks WHERE assessment_id = $1")
            .bind(id)
            .fetch_optional(self.reader())
            .await?;
        let Some(row) = row else { return Ok(None) };
        let decoded = spawn_blocking(move || track_from_row(&row)).await;
        decoded.map_err(|panic| StorageError::Corrupt(format!("decoding joints failed: {panic}")))?.map(Some)
    }
}

fn track_from_row(row: &Row) -> Result<JointTrack, StorageError> {
    let joints: Vec<Joint> = row::json(row, "joints")?;
    let n_frames = usize::try_from(row::count(row, "n_frames")?).unwrap_or(usize::MAX);
    let n_values = n_frames.saturating_mul(3 * joints.len());
    let mut decoder = Decoder::of_pieces(MOST_VALUES)?;
    let (mut time_ns, mut values) = (Vec::new(), Vec::new());
    decoder.decode_time(row.try_get("time")?, n_frames, &mut time_ns)?;
    decoder.decode_f32(row.try_get("positions")?, n_values, &mut values)?;
    let place = |t: usize, joint: usize| std::array::from_fn(|axis| values[(3 * joint + axis) * n_frames + t]);
    let frame = |t: usize| (0..joints.len()).map(move |joint| (t, joint));
    let positions_m = (0..n_frames).flat_map(frame).map(|(t, joint)| place(t, joint)).collect();
    Ok(JointTrack { joints, time_ns, positions_m })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_is_coded_column_by_column() {
        let track = JointTrack {
            joints: vec![Joint::Head, Joint::Pelvis],
            time_ns: vec![0, 33, 67],
            positions_m: (0..6).map(|i| [i as f32, f32::NAN, -1.0]).collect(),
        };
        let encoded = EncodedTrack::encode(&track).unwrap();
        let mut values = Vec::new();
        let mut decoder = Decoder::of_pieces(MOST_VALUES).unwrap();
        decoder.decode_f32(&encoded.positions, 18, &mut values).unwrap();
        assert_eq!(values[..3], [0.0, 2.0, 4.0]);
        assert!(values[3].is_nan());
        assert!(decoder.decode_f32(&encoded.positions, MOST_VALUES + 1, &mut values).is_err());
        assert!(EncodedTrack::encode(&JointTrack { time_ns: vec![0], ..track }).is_err());
    }
}
