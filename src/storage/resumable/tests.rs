//! The protocol's conformance suites on what is written here, and what the row of an upload goes through.

use super::*;
use crate::storage::tests::Clinic;
use bytes::Bytes;
use futures::stream;
use std::io;
use tus_protocol::state::conformance::assert_state_store_semantics;
use tus_protocol::storage::conformance::assert_upload_write_semantics;
use tus_protocol::{AppendRequest, ChunkStream, StateStore, Storage, UploadState, WriteMode};

const KEPT: Duration = Duration::hours(24);

/// A row and a file of an upload of ten bytes.
async fn begun(clinic: &Clinic, access: Access) -> ResumableUploadId {
    let id = ResumableUploadId::new();
    let mut state = UploadState::new(id.to_string()).with_length(10);
    state.set_storage_handle(clinic.store.partial_files().create(state.id()).await.unwrap());
    let states = UploadStates::new(&clinic.store, access, Some(clinic.session), KEPT);
    states.set(&state, WriteMode::CreateNew).await.unwrap();
    id
}

#[tokio::test]
async fn the_files_conform_to_the_protocol() {
    let folder = tempfile::tempdir().unwrap();
    assert_upload_write_semantics(&PartialFiles::in_directory(folder.path())).await;
}

#[tokio::test]
async fn the_states_conform_to_the_protocol() {
    let clinic = Clinic::open().await;
    assert_state_store_semantics(&UploadStates::new(&clinic.store, clinic.admin, Some(clinic.session), KEPT)).await;
}

#[tokio::test]
async fn a_file_is_not_as_long_as_its_recording_before_the_end_was_good() {
    let folder = tempfile::tempdir().unwrap();
    let files = PartialFiles::in_directory(folder.path());
    let handle = files.create("one").await.unwrap();
    let path = folder.path().join("resumable").join("one");
    let seen = std::sync::Arc::new(std::sync::Mutex::new(0));
    let looking = seen.clone();
    let end = stream::once(async move {
        *looking.lock().unwrap() = std::fs::metadata(path).unwrap().len();
        Err(io::Error::from(io::ErrorKind::InvalidData))
    });
    let chunks = stream::iter([Ok(Bytes::from_static(b"01234")), Ok(Bytes::from_static(b"56789"))]);
    let data = ChunkStream::from_stream(Box::pin(futures::StreamExt::chain(chunks, end)));
    files.append(AppendRequest::new(handle.clone(), 0, data, true)).await.unwrap_err();
    assert!(*seen.lock().unwrap() < 10);
    assert_eq!(files.size(&handle).await.unwrap(), Some(0));
}

#[tokio::test]
async fn a_name_that_leads_out_of_the_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = PartialFiles::in_directory(folder.path());
    for name in ["../one", "..", ".", "a/b", ""] {
        assert!(files.create(name).await.is_err(), "{name}");
    }
}

#[tokio::test]
async fn an_upload_is_seen_only_within_reach_and_ends_once() {
    let clinic = Clinic::open().await;
    let id = begun(&clinic, clinic.admin).await;
    let of_device = UploadStates::new(&clinic.store, clinic.device, None, KEPT);
    assert!(clinic.store.resumable_upload(&clinic.device, id).await.is_err(), "the session is another's");
    assert!(of_device.get(&id.to_string()).await.unwrap().is_none());

    clinic.store.refuse_resumable_upload(id, "{\"code\": \"first\"}").await.unwrap();
    clinic.store.refuse_resumable_upload(id, "{\"code\": \"second\"}").await.unwrap();
    let upload = clinic.store.resumable_upload(&clinic.admin, id).await.unwrap();
    assert_eq!(upload.state, ResumableState::Refused);
    assert_eq!(upload.problem.as_deref(), Some("{\"code\": \"first\"}"));

    clinic.clock.advance(OUTCOME_KEPT);
    clinic.store.forget_resumable_uploads().await.unwrap();
    assert!(clinic.store.resumable_upload(&clinic.admin, id).await.is_err());
}

#[tokio::test]
async fn the_time_of_an_upload_begins_anew_with_every_byte() {
    let clinic = Clinic::open().await;
    let id = begun(&clinic, clinic.admin).await;
    clinic.clock.advance(Duration::hours(23));
    let states = UploadStates::new(&clinic.store, clinic.admin, None, KEPT);
    let state = states.get(&id.to_string()).await.unwrap().unwrap();
    states.set(&state, WriteMode::Update).await.unwrap();
    clinic.clock.advance(Duration::hours(23));
    assert!(!clinic.store.expire_resumable_upload(id).await.unwrap());
    clinic.clock.advance(Duration::hours(1));
    assert!(clinic.store.resumable_upload(&clinic.admin, id).await.unwrap().is_expired(clinic.store.now()));
    assert!(clinic.store.expire_resumable_upload(id).await.unwrap());
    assert!(states.set(&state, WriteMode::Update).await.is_err(), "nothing is added to what was given up");
}

#[tokio::test]
async fn an_upload_goes_with_its_session() {
    let clinic = Clinic::open().await;
    let id = begun(&clinic, clinic.admin).await;
    let mut transaction = clinic.store.begin().await.unwrap();
    query("DELETE FROM sessions WHERE id = $1").bind(clinic.session).execute(&mut transaction).await.unwrap();
    transaction.commit().await.unwrap();
    assert!(clinic.store.resumable_upload_to_finish(id).await.is_err());
}
