//! The report of a patient with a thousand sessions, from a database of a hundred thousand assessments, over HTTP.
//!
//! Prints percentiles of the time from request to answer; `cargo bench --bench report` fills a temporary database first.

use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};
use std::time::{Duration, Instant};
use surefoot::api::{self, AppState};
use surefoot::cli::serve::recording_limits;
use surefoot::config::Config;
use surefoot::queue::{Queue, QueueSettings};
use surefoot::storage::Store;

/// Patients, sessions of each, and measures of each session.
const PATIENTS: u32 = 100;
const SESSIONS: u32 = 1000;
const MEASURES: [&str; 12] = [
    "usual_speed_mps",
    "step_length_m",
    "step_width_m",
    "step_width_sd_m",
    "step_time_s",
    "stride_time_s",
    "stride_time_sd_s",
    "cadence_spm",
    "double_support_pct",
    "five_times_sit_to_stand_s",
    "near_tandem_hold_s",
    "trunk_sway_path_m",
];
/// Requests that are measured, one after the other.
const REQUESTS: usize = 400;

#[tokio::main]
async fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = Config { data_dir: folder.path().to_owned(), ..Config::default() };
    let store = Store::open(&config.data_dir).await.expect("a store");
    let key = store.ensure_first_admin().await.expect("a database").expect("an empty one").reveal().to_owned();
    let begun = Instant::now();
    fill(&config).await.expect("rows");
    println!(
        "{PATIENTS} patients, {} assessments, filled in {:.0} s",
        PATIENTS * SESSIONS,
        begun.elapsed().as_secs_f64()
    );

    let limits = recording_limits(&config);
    let state = AppState::new(Queue::new(store, QueueSettings::from(&config)), config, limits).expect("a state");
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("an address");
    tokio::spawn(async move { axum::serve(listener, api::router(state)).await });

    let client = reqwest::Client::builder().timeout(Duration::from_secs(30)).build().expect("a client");
    let get = async |path: &str| {
        let begun = Instant::now();
        let answer = client.get(format!("http://{address}{path}")).bearer_auth(&key).send().await.expect("an answer");
        assert!(answer.status().is_success(), "{path}: {}", answer.status());
        let body: serde_json::Value = answer.json().await.expect("JSON");
        (begun.elapsed().as_secs_f64() * 1e3, body)
    };
    let (_, page) = get("/v1/patients?limit=100").await;
    let patients: Vec<String> = page["items"]
        .as_array()
        .expect("patients")
        .iter()
        .filter_map(|patient| patient["id"].as_str().map(str::to_owned))
        .collect();
    for what in ["report", "fall-risk", "trends", "fhir-bundle", "measures"] {
        let mut times = Vec::with_capacity(REQUESTS);
        for i in 0..REQUESTS {
            times.push(get(&format!("/v1/patients/{}/{what}", patients[i % patients.len()])).await.0);
        }
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
        println!("{what:<12} p50 {:6.1} ms   p95 {:6.1} ms   p99 {:6.1} ms", at(0.5), at(0.95), at(0.99));
    }
}

/// Writes the rows as the service would have, in one transaction.
async fn fill(config: &Config) -> Result<(), sqlx::Error> {
    let options = SqliteConnectOptions::new().filename(config.data_dir.join("surefoot.sqlite"));
    let mut connection = SqlitePool::connect_with(options).await?.acquire().await?.detach();
    let names = serde_json::to_string(&MEASURES).unwrap_or_default();
    let performance = r#"{"protocol": "walk", "protocol_version": 1, "status": "measured", "reason": "", "recognized": ["walk"],
                          "repetitions": [], "measures": []}"#;
    let provenance = serde_json::to_string(&surefoot::assessment::Provenance::default()).unwrap_or_default();
    // Ids that sort by time: a number of the row, then random bytes.
    let statements = [
        "BEGIN",
        "CREATE TEMP TABLE numbers AS WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 99999)
         SELECT i, i % 100 AS patient, i / 100 AS session FROM n",
        "CREATE TEMP TABLE whom AS SELECT organisation_id, id AS client_id FROM clients LIMIT 1",
        "INSERT INTO patients (id, organisation_id, pseudonym, birth_year, sex, uses_walking_aid, created_at)
         SELECT CAST(unhex(printf('%012x', patient)) || randomblob(10) AS BLOB), organisation_id, 'P-' || patient, 1948, 'female', 0, 0
         FROM numbers, whom WHERE session = 0",
        "CREATE TEMP TABLE people AS SELECT id, CAST(substr(pseudonym, 3) AS INTEGER) AS patient FROM patients",
        "INSERT INTO sessions (id, organisation_id, patient_id, created_by, started_at, protocol, created_at)
         SELECT CAST(unhex(printf('%012x', i)) || randomblob(10) AS BLOB), organisation_id, people.id, client_id,
                session * 43200000, 'walk', session * 43200000
         FROM numbers JOIN people USING (patient), whom ORDER BY i",
        "INSERT INTO recordings (id, organisation_id, session_id, created_by, size_bytes, sha256, blob_key, inspection,
                                 created_at)
         SELECT CAST(substr(id, 1, 6) || randomblob(10) AS BLOB), organisation_id, id, created_by, 1, printf('%064d', 0), '', '{}',
                created_at FROM sessions ORDER BY id",
        "INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, settings, queued_at)
         SELECT CAST(substr(id, 1, 6) || randomblob(10) AS BLOB), organisation_id, id, 'done', 3, '{}', created_at
         FROM recordings ORDER BY id",
        "INSERT INTO assessments (id, organisation_id, recording_id, job_id, pipeline, method, channels, summary, quality,
                                  provenance, n_samples, created_at, performance)
         SELECT CAST(substr(j.id, 1, 6) || randomblob(10) AS BLOB), j.organisation_id, j.recording_id, j.id, 'joint_angles', 'iekf', '[]',
                '[]', '{\"coverage\": 0.98, \"warnings\": []}', ?2, 0, j.queued_at, ?1
         FROM jobs j ORDER BY j.id",
        "INSERT INTO measures (id, organisation_id, patient_id, name, value, standard_error, n_observations, protocol,
                               assessment_id, recording_id, session_id, measured_at, created_at)
         SELECT CAST(substr(a.id, 1, 6) || unhex(printf('%04x', one.key)) || randomblob(8) AS BLOB), a.organisation_id, s.patient_id,
                one.value, 1.0 + abs(random() % 1000) / 5000.0, 0.02, 20, 'walk', a.id, r.id, s.id, s.started_at, a.created_at
         FROM assessments a JOIN recordings r ON r.id = a.recording_id JOIN sessions s ON s.id = r.session_id,
              json_each(?1) one ORDER BY a.id",
        "COMMIT",
    ];
    for statement in statements {
        let first = if statement.contains("INTO measures") { names.as_str() } else { performance };
        let query = sqlx::query(statement);
        let query = if statement.contains("?1") { query.bind(first) } else { query };
        let query = if statement.contains("?2") { query.bind(provenance.as_str()) } else { query };
        query.execute(&mut connection).await?;
    }
    Ok(())
}
