//! A disk that fills up: 507, and what was stored stays.

use crate::support::{App, Service, recording};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A small file system in memory; unmounted when it is dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// None where this process may not mount.
    fn mount(at: &Path, size: &str) -> Option<Self> {
        std::fs::create_dir_all(at).unwrap();
        let options = format!("size={size}");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &options, "tmpfs"]).arg(at).output();
        mounted.is_ok_and(|output| output.status.success()).then(|| Self(at.to_owned()))
    }

    fn resize(&self, size: &str) {
        let options = format!("remount,size={size}");
        assert!(Command::new("mount").args(["-o", &options]).arg(&self.0).status().unwrap().success());
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_is_told_and_costs_nothing_that_was_stored() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let Some(disk) = SmallDisk::mount(&data, "6m") else {
        println!("skipped: this process may not mount a small file system");
        return;
    };
    let service = Service::start(&data, &[("SUREFOOT_WORKERS", "1")]);
    let app = App::new(&service, service.admin_key.as_ref().unwrap());
    let session = app.session("P-1").await;

    let mut stored = Vec::new();
    let refused = loop {
        assert!(stored.len() < 200, "the disk never filled up");
        let content = recording(10, stored.len());
        let (status, answer) = app.try_upload(&session, &format!("upload-{}", stored.len()), content).await.unwrap();
        match status {
            202 => stored.push(answer["recording"]["id"].as_str().unwrap().to_owned()),
            507 => break answer,
            _ => panic!("{status} {answer:#}"),
        }
    };
    assert_eq!(refused["code"], "out_of_space", "{refused:#}");
    assert!(!stored.is_empty());

    disk.resize("200m");
    let again = recording(10, stored.len());
    let (status, answer) = app.try_upload(&session, &format!("upload-{}", stored.len()), again).await.unwrap();
    assert_eq!(status, 202, "{answer:#}");
    stored.push(answer["recording"]["id"].as_str().unwrap().to_owned());
    app.until_all_jobs_are_over().await;
    for id in &stored {
        let jobs = app.list(&format!("/v1/jobs?recording_id={id}")).await;
        assert_eq!((jobs.len(), jobs[0]["state"].as_str().unwrap()), (1, "done"), "{jobs:#?}");
    }
    assert_eq!(app.list(&format!("/v1/sessions/{session}/recordings")).await.len(), stored.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_keeps_what_had_arrived_of_an_upload_and_it_goes_on_when_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let Some(disk) = SmallDisk::mount(&data, "6m") else {
        println!("skipped: this process may not mount a small file system");
        return;
    };
    let service = Service::start(&data, &[("SUREFOOT_WORKERS", "0")]);
    let app = App::new(&service, service.admin_key.as_ref().unwrap());
    let session = app.session("P-1").await;
    let content = recording(600, 0);
    assert!(content.len() > 8 << 20, "{} bytes fit", content.len());
    let upload = app.begin_upload(&session, content.len(), "application/json").await;

    let mut offset = 0;
    let refused = loop {
        let end = (offset + (256 << 10)).min(content.len());
        match app.continue_upload(&upload, offset, content[offset..end].to_vec()).await.unwrap() {
            204 => offset = end,
            refused => break refused,
        }
    };
    assert_eq!(refused, 507);
    assert!(offset > 1 << 20, "only {offset} bytes found room");
    disk.resize("200m");
    // A piece that was written before the row ran out of room counts; nothing that was promised is missing.
    let there = app.upload_offset(&upload).await;
    assert!(there >= offset, "{offset} bytes were promised, {there} are there");
    assert_eq!(app.continue_upload(&upload, there, content[there..].to_vec()).await, Some(204));
    let stored = app.get(&upload).await;
    let id = stored["recording_id"].as_str().unwrap_or_else(|| panic!("{stored:#}"));
    assert!(app.get_bytes(&format!("/v1/recordings/{id}/content")).await == content);
}
