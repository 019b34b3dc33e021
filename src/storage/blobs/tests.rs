use super::*;
use object_store::memory::InMemory;

fn entries(folder: &Path) -> usize {
    fs::read_dir(folder).unwrap().count()
}

async fn store_bytes(store: &BlobStore, chunks: &[&'static [u8]]) -> StoredBlob {
    let mut writer = store.writer().await.unwrap();
    for chunk in chunks {
        writer.write(Bytes::from_static(chunk)).await.unwrap();
    }
    writer.seal().await.unwrap().keep().await.unwrap()
}

async fn read_back(store: &BlobStore, blob: &StoredBlob) -> Vec<u8> {
    let mut reader = store.reader(blob).await.unwrap();
    spawn_blocking(move || {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).unwrap();
        bytes
    })
    .await
    .unwrap()
}

#[tokio::test]
async fn a_kept_upload_is_read_back_and_named_by_its_digest() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let blob = store_bytes(&store, &[b"ab", b"", b"c"]).await;
    // SHA-256 of "abc", FIPS 180-2 appendix B.1.
    assert_eq!(blob.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    assert_eq!((blob.size_bytes, blob.key.as_str()), (3, format!("ba/{}", blob.sha256).as_str()));
    assert_eq!(read_back(&store, &blob).await, b"abc");
    assert_eq!(entries(&folder.path().join(PART_FOLDER)), 0);
}

#[tokio::test]
async fn an_upload_of_many_batches_arrives_whole() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let bytes: Vec<u8> =
        (0..3 * BATCH_BYTES as u32 + 17).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let mut writer = store.writer().await.unwrap();
    for chunk in bytes.chunks(100_003) {
        writer.write(Bytes::copy_from_slice(chunk)).await.unwrap();
    }
    let sealed = writer.seal().await.unwrap();
    assert_eq!(sealed.sha256(), hex::encode(Sha256::digest(&bytes)));
    let mut early = Vec::new();
    sealed.reader().unwrap().read_to_end(&mut early).unwrap();
    assert_eq!(early, bytes);
    let blob = sealed.keep().await.unwrap();
    assert_eq!(read_back(&store, &blob).await, bytes);
}

#[tokio::test]
async fn the_same_bytes_are_stored_once() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let first = store_bytes(&store, &[b"same"]).await;
    let second = store_bytes(&store, &[b"sa", b"me"]).await;
    assert_eq!(first, second);
    assert_eq!(entries(&folder.path().join(BLOB_FOLDER).join(&first.key[..2])), 1);
    assert_eq!(entries(&folder.path().join(PART_FOLDER)), 0);
}

#[tokio::test]
async fn an_upload_that_is_dropped_leaves_nothing_at_any_point() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    drop(store.writer().await.unwrap());
    let mut writer = store.writer().await.unwrap();
    writer.write(Bytes::from(vec![7; 2 * BATCH_BYTES])).await.unwrap();
    drop(writer);
    let mut writer = store.writer().await.unwrap();
    writer.write(Bytes::from_static(b"sealed, not kept")).await.unwrap();
    drop(writer.seal().await.unwrap());
    assert_eq!(entries(&folder.path().join(PART_FOLDER)), 0);
    assert_eq!(entries(&folder.path().join(BLOB_FOLDER)), 0);
}

#[tokio::test]
async fn opening_removes_the_parts_of_dead_uploads_and_spares_the_living() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let mut alive = store.writer().await.unwrap();
    alive.write(Bytes::from_static(b"alive")).await.unwrap();
    fs::write(folder.path().join(PART_FOLDER).join("dead"), b"half an upload").unwrap();
    BlobStore::open(folder.path()).await.unwrap();
    assert_eq!(entries(&folder.path().join(PART_FOLDER)), 1);
    let blob = alive.seal().await.unwrap().keep().await.unwrap();
    assert_eq!(read_back(&store, &blob).await, b"alive");
}

#[tokio::test]
async fn a_blob_in_another_object_store_is_read_back_as_a_stream() {
    let parts = tempfile::tempdir().unwrap();
    let store = BlobStore::in_object_store(parts.path().into(), Arc::new(InMemory::new())).await.unwrap();
    let blob = store_bytes(&store, &[b"far ", b"away"]).await;
    assert_eq!(read_back(&store, &blob).await, b"far away");
    assert_eq!(store_bytes(&store, &[b"far away"]).await, blob);
    assert_eq!(entries(parts.path()), 0);
}

#[tokio::test]
async fn a_blob_that_is_not_there_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let absent = StoredBlob { key: "00/absent".into(), sha256: "0".repeat(64), size_bytes: 1 };
    assert!(matches!(store.reader(&absent).await, Err(StorageError::Blob { .. })));
}

#[tokio::test]
async fn a_blob_that_was_changed_is_noticed_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path()).await.unwrap();
    let blob = store_bytes(&store, &[b"a recording"]).await;
    fs::write(folder.path().join(BLOB_FOLDER).join(&blob.key), b"A recording").unwrap();
    let mut reader = store.reader(&blob).await.unwrap();
    let error = spawn_blocking(move || reader.read_to_end(&mut Vec::new()).unwrap_err()).await.unwrap();
    assert!(error.to_string().contains("not what was stored"), "{error}");
}

#[tokio::test]
async fn a_file_becomes_a_blob_and_stays_under_its_own_name_too() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("upload");
    fs::write(&file, b"abc").unwrap();
    let sha256 = hex::encode(Sha256::digest(b"abc"));
    let local = BlobStore::open(folder.path()).await.unwrap();
    let remote = BlobStore::in_object_store(folder.path().join("elsewhere"), Arc::new(InMemory::new())).await.unwrap();
    for store in [local, remote] {
        // The second time is that of a process which died before it could say that the blob is stored.
        for _ in 0..2 {
            let blob = store.keep_file(&file, sha256.clone(), 3).await.unwrap();
            assert_eq!(read_back(&store, &blob).await, b"abc");
            assert_eq!(fs::read(&file).unwrap(), b"abc");
        }
    }
    assert_eq!(entries(&folder.path().join(PART_FOLDER)), 0);
    assert_eq!(entries(&folder.path().join("elsewhere")), 0);
}
