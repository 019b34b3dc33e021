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
