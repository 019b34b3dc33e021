//! The pages in a real Chromium, driven by `tests/web/pages.mjs`, on real assessments of simulated recordings. Says so and passes
//! where node, the npm packages (`npm ci` in `web`) or Chromium are absent; CHROMIUM names another binary than Debian's.

use crate::support::Clinic;
use serde_json::{Value, json};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use surefoot::recording::encode;
use surefoot::synthetic::walker::trousers::trousers;
use surefoot::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

/// What is missing for this test, if anything.
fn missing(root: &Path, chromium: &Path) -> Option<String> {
    let node = Command::new("node").arg("--version").output();
    if !node.is_ok_and(|output| output.status.success()) {
        return Some("node is not installed".to_owned());
    }
    for package in ["playwright-core", "axe-core"] {
        if !root.join("web/node_modules").join(package).is_dir() {
            return Some(format!("web/node_modules has no {package}: run npm ci in web"));
        }
    }
    (!chromium.is_file()).then(|| format!("{} is not there", chromium.display()))
}

fn exercise(preset: Preset, seed: u64) -> Vec<u8> {
    let settings = SimulationSettings::new(Exercise::BackKnee, preset, seed);
    encode::mcap(&simulate(&SimulationSettings { duration_s: 12.0, ..settings }).unwrap().recording).unwrap()
}

/// A few seconds of a brisk walk as depth images.
fn walk() -> Vec<u8> {
    let settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.8);
    let settings = WalkerSettings { duration_s: 6.0, rate_hz: 20.0, ..settings };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    simulation.write(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_pages_work_in_a_browser_by_keyboard_on_a_tablet_in_light_and_dark_and_on_paper() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let chromium = std::env::var_os("CHROMIUM").map_or_else(|| PathBuf::from("/usr/bin/chromium"), PathBuf::from);
    if let Some(reason) = missing(root, &chromium) {
        println!("skipped: {reason}");
        return;
    }
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-017").await;
    clinic.made("/v1/patients", &json!({"pseudonym": "Q-2"})).await;
    let [_, exercised] = clinic.uploaded(&patient, "back_knee", exercise(Preset::Failures, 1)).await;
    let [_, walked] = clinic.uploaded(&patient, "walk", walk()).await;
    clinic.run_pending_jobs().await;
    let (exercised, walked) = (clinic.assessment_of(&exercised).await, clinic.assessment_of(&walked).await);
    // This one waits until the browser looks at it.
    let [live, _] = clinic.uploaded(&patient, "back_knee", exercise(Preset::Table1, 2)).await;

    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let server = tokio::spawn(axum::serve(listener, clinic.router.clone()).into_future());

    let folder = tempfile::tempdir().unwrap();
    let pictures = std::env::var_os("SUREFOOT_SCREENSHOTS").map_or_else(|| folder.path().to_owned(), PathBuf::from);
    std::fs::create_dir_all(&pictures).unwrap();
    let go = folder.path().join("go");
    let task = json!({
        "address": address, "key": clinic.key, "chromium": chromium, "pictures": pictures, "go": go,
        "patient": patient, "pseudonym": "P-017", "assessment": exercised, "walk": walked, "live": live,
    });
    let script = root.join("tests/web/pages.mjs");
    let run = tokio::task::spawn_blocking(move || Command::new("node").arg(script).arg(task.to_string()).output());
    let work = async {
        while !go.exists() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        clinic.run_pending_jobs().await;
        std::future::pending::<()>().await;
    };
    let output = tokio::select! {
        output = run => output.unwrap().unwrap(),
        () = work => unreachable!("work does not end by itself"),
    };
    server.abort();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{out}");
    assert!(output.status.success(), "{out}\n{err}");
    let report: Value = serde_json::from_str(out.lines().last().unwrap()).unwrap();
    assert!(report["checks"].as_u64().unwrap() >= 30, "{report:#}");
}
