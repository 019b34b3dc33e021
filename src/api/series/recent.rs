//! Answers that were written a moment ago. Several people look at the same assessment, a page asks for it again, and it
//! never changes: its text is kept, as long as newer ones leave room.

use crate::api::etag::ETag;
use bytes::Bytes;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that are kept at most: three assessments of ten minutes with all their intervals.
const ROOM: usize = 24 << 20;

/// Answers by their tag, the one that was asked for last in front; a clone is another handle to the same.
#[derive(Debug, Clone, Default)]
pub struct RecentSeries(Arc<Mutex<Kept>>);

#[derive(Debug, Default)]
struct Kept {
    answers: VecDeque<(ETag, Bytes)>,
    n_bytes: usize,
}

impl RecentSeries {
    /// The answer with this tag. Whether the caller may see it is for the caller to know.
    pub(super) fn find(&self, tag: &ETag) -> Option<Bytes> {
        let mut kept = self.lock();
        let place = kept.answers.iter().position(|(other, _)| other == tag)?;
        let found = kept.answers.remove(place)?;
        let answer = found.1.clone();
        kept.answers.push_front(found);
        Some(answer)
    }

    /// Keeps an answer; those that were not asked for longest make room.
    pub(super) fn keep(&self, tag: &ETag, answer: &Bytes) {
        let mut kept = self.lock();
        if answer.len() > ROOM || kept.answers.iter().any(|(other, _)| other == tag) {
            return;
        }
        kept.n_bytes += answer.len();
        kept.answers.push_front((tag.clone(), answer.clone()));
        while kept.n_bytes > ROOM {
            let Some((_, oldest)) = kept.answers.pop_back() else { break };
            kept.n_bytes -= oldest.len();
        }
    }

    /// Forgets everything: somebody's data are to be gone, and nobody keeps a list of whose answers these are.
    pub fn clear(&self) {
        *self.lock() = Kept::default();
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        // Nothing panics while it holds the lock halfway through a change.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_that_was_not_asked_for_longest_makes_room() {
        let recent = RecentSeries::default();
        let tag = |name: &str| ETag::of(&[name.as_bytes()]);
        let third = Bytes::from(vec![0; ROOM / 3]);
        for name in ["a", "b", "c"] {
            recent.keep(&tag(name), &third);
        }
        assert!(recent.find(&tag("a")).is_some());
        recent.keep(&tag("d"), &third);
        let found: Vec<bool> = ["a", "b", "c", "d"].map(|name| recent.find(&tag(name)).is_some()).into();
        assert_eq!(found, [true, false, true, true]);
        assert_eq!(recent.lock().n_bytes, 3 * third.len());
    }

    #[test]
    fn an_answer_larger_than_the_room_is_not_kept() {
        let recent = RecentSeries::default();
        let tag = ETag::of(&[b"large"]);
        recent.keep(&tag, &Bytes::from(vec![0; ROOM + 1]));
        assert!(recent.find(&tag).is_none());
    }
}
