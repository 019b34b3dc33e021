//! `surefoot demo`: one recording's whole journey, over real HTTP, beside the truth.

use super::serve::{self, Running};
use crate::assessment::JointAngleSettings;
use crate::config::Config;
use crate::recording::{Recording, encode};
use crate::signal::interpolation::interpolate;
use crate::storage::Role;
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use anyhow::{Context, bail};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Deserialize;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Run the whole journey once: simulate, upload, assess, compare with the truth
///
/// Starts the service on a data directory of its own, makes a synthetic exercise recording whose true joint angles are
/// known, uploads it over HTTP, follows the job, and prints the estimated angles beside the truth. Then it keeps
/// serving, so that you can look around with the key it prints.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Examples:\n  surefoot demo\n  surefoot demo --exit\n  \
    surefoot demo --exercise sit_front_knee --noise kinect-v2 --seed 4")]
pub struct Args {
    /// End after the comparison: status 0 when the estimates agree with the truth within the limits that are printed
    #[arg(long)]
    exit: bool,
    /// back_knee, sit_front_knee, side_hip, step or near_tandem
    #[arg(long, default_value = "back_knee")]
    exercise: Exercise,
    /// Sensor errors: clean, table1, kinect-v2, failures
    #[arg(long, default_value = "table1", value_name = "PRESET")]
    noise: Preset,
    /// Seed of the subject and of the sensor's errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Directory of the database and the recordings; made when absent
    #[arg(long, default_value = "surefoot-demo", value_name = "DIR")]
    data_dir: PathBuf,
    /// Address to listen on; port 0 chooses a free one
    #[arg(long, default_value = "127.0.0.1:8080", value_name = "ADDRESS:PORT")]
    listen: SocketAddr,
    /// Print the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Largest mean absolute error with which the demo counts as passed, degrees. They are the bars that the default method
/// has to hold on simulated recordings with the noise of [angles] Table 1, with a margin for a single subject.
const LIMITS_DEG: [(&str, f64); 3] = [("knee_flexion_deg", 5.0), ("hip_flexion_deg", 4.0), ("hip_abduction_deg", 2.5)];

/// One channel's estimate beside the truth, degrees.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
struct Comparison {
    channel: String,
    estimated_min_deg: f64,
    estimated_max_deg: f64,
    true_min_deg: f64,
    true_max_deg: f64,
    mean_absolute_error_deg: f64,
    interval_coverage: f64,
    limit_deg: f64,
}

#[derive(Debug, Deserialize)]
struct SeriesBody {
    time_s: Vec<f64>,
    channels: Vec<ChannelBody>,
}

#[derive(Debug, Deserialize)]
struct ChannelBody {
    channel: String,
    value: Vec<Option<f64>>,
    low: Vec<Option<f64>>,
    high: Vec<Option<f64>>,
}

/// Runs the command.
///
/// # Errors
/// When a step fails, or with `--exit` when the estimates do not agree with the truth.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let config = Config { data_dir: args.data_dir.clone(), listen: args.listen, ..Config::default() };
    let key = demo_key(&config).await?;
    let running = serve::start(config).await?;
    let outcome = journey(args, &running, &key).await;
    if args.exit || outcome.is_err() {
        running.stop().await?;
        return verdict(outcome?);
    }
    let address = running.addr;
    println!("\nClinician's pages: http://{address}/app");
    println!("API documentation: http://{address}/docs");
    println!("Your key:          {key}");
    println!("Ctrl-C ends it.");
    serve::until_told_to_end(running).await
}

/// A clinician's key of the demo's own; a data directory may be used again.
async fn demo_key(config: &Config) -> anyhow::Result<String> {
    let store = serve::open_store(config).await?;
    store.ensure_first_admin().await?;
    let organisations = store.organisations().await?;
    let organisation = organisations.first().context("the data directory has no organisation")?;
    let (_, key) = store.create_client(organisation.id, Role::Clinician, "demo").await?;
    store.close().await;
    Ok(key.reveal().to_owned())
}

async fn journey(args: &Args, running: &Running, key: &str) -> anyhow::Result<Vec<Comparison>> {
    let say = |line: String| {
        if !args.json {
            println!("{line}");
        }
    };
    let truth = simulate(&SimulationSettings::new(args.exercise, args.noise, args.seed))?.recording;
    let bytes = encode::mcap(&truth)?;
    say(format!("1. simulated   {} with noise {}, {} bytes", args.exercise, args.noise, bytes.len()));
    let client = Client::new(running.addr, key)?;
    let pseudonym = format!("demo-{}", uuid::Uuid::now_v7().simple());
    let patient = client.post("/v1/patients", &json!({"pseudonym": pseudonym, "height_m": 1.7})).await?;
    let consent = json!({"scope": "assessment", "text_version": "demo"});
    client.post(&format!("/v1/patients/{}/consents", text(&patient, "id")?), &consent).await?;
    let session = json!({"patient_id": patient["id"], "protocol": args.exercise.name()});
    let session = client.post("/v1/sessions", &session).await?;
    let accepted = client.upload(&format!("/v1/sessions/{}/recordings", text(&session, "id")?), bytes).await?;
    let job = text(&accepted["job"], "id")?.to_owned();
    say(format!("2. uploaded    recording {}, job {job}", text(&accepted["recording"], "id")?));
    let assessment = client.follow(&job).await?;
    say(format!("3. assessed    http://{}/v1/assessments/{assessment}", running.addr));
    let series: SeriesBody =
        serde_json::from_value(client.get(&format!("/v1/assessments/{assessment}/series")).await?)?;
    let method = JointAngleSettings::default().method.name();
    say(format!("4. compared    method {method}, degrees\n"));
    let comparisons = compare(&truth, &series)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&json!({"method": method, "channels": comparisons}))?);
    } else {
        print_table(&comparisons);
    }
    Ok(comparisons)
}

/// Estimates beside the truth on the recording's reference channels.
fn compare(truth: &Recording, series: &SeriesBody) -> anyhow::Result<Vec<Comparison>> {
    let mut comparisons = Vec::new();
    for (suffix, limit_deg) in LIMITS_DEG {
        for side in ["left", "right"] {
            let name = format!("{side}_{suffix}");
            let reference = truth.references.iter().find(|r| r.channel == name).context("no truth in the recording")?;
            let channel = series.channels.iter().find(|c| c.channel == name).context("a channel is missing")?;
            comparisons.push(compare_channel(reference, channel, &series.time_s, limit_deg)?);
        }
    }
    Ok(comparisons)
}

fn compare_channel(
    reference: &crate::recording::ReferenceSeries,
    channel: &ChannelBody,
    time_s: &[f64],
    limit_deg: f64,
) -> anyhow::Result<Comparison> {
    let (mut n, mut error, mut inside) = (0_u32, 0.0, 0_u32);
    let (mut estimated, mut actual) = ([f64::INFINITY, f64::NEG_INFINITY], [f64::INFINITY, f64::NEG_INFINITY]);
    for (i, time) in time_s.iter().enumerate() {
        let at_ns = (time * 1e9).round() as i64 - reference.clock_offset_ns;
        let truth = interpolate(&reference.time_ns, &reference.values, at_ns);
        let Some(value) = channel.value[i].filter(|_| truth.is_finite()) else { continue };
        n += 1;
        error += (value - truth).abs();
        estimated = [estimated[0].min(value), estimated[1].max(value)];
        actual = [actual[0].min(truth), actual[1].max(truth)];
        let covers = channel.low[i].is_some_and(|l| l <= truth) && channel.high[i].is_some_and(|h| truth <= h);
        inside += u32::from(covers);
    }
    if n == 0 {
        bail!("no sample of {} can be compared", channel.channel);
    }
    Ok(Comparison {
        channel: channel.channel.clone(),
        estimated_min_deg: estimated[0],
        estimated_max_deg: estimated[1],
        true_min_deg: actual[0],
        true_max_deg: actual[1],
        mean_absolute_error_deg: error / f64::from(n),
        interval_coverage: f64::from(inside) / f64::from(n),
        limit_deg,
    })
}

fn print_table(comparisons: &[Comparison]) {
    println!("{:<26}{:>17}{:>17}{:>8}{:>8}{:>12}", "channel", "estimated", "true", "error", "limit", "95 % holds");
    for c in comparisons {
        println!(
            "{:<26}{:>8.1} … {:>6.1}{:>8.1} … {:>6.1}{:>8.2}{:>8.1}{:>11.0}%",
            c.channel,
            c.estimated_min_deg,
            c.estimated_max_deg,
            c.true_min_deg,
            c.true_max_deg,
            c.mean_absolute_error_deg,
            c.limit_deg,
            100.0 * c.interval_coverage
        );
    }
}

fn verdict(comparisons: Vec<Comparison>) -> anyhow::Result<()> {
    let beyond = comparisons.iter().filter(|c| c.mean_absolute_error_deg > c.limit_deg);
    let names: Vec<&str> = beyond.map(|c| c.channel.as_str()).collect();
    if !names.is_empty() {
        bail!("the mean absolute error is beyond its limit for {}", names.join(", "));
    }
    Ok(())
}

/// A client of the service, as a home app would be one.
struct Client {
    http: reqwest::Client,
    base: String,
    key: String,
}

impl Client {
    fn new(addr: SocketAddr, key: &str) -> anyhow::Result<Self> {
        let http = reqwest::Client::builder().build()?;
        // A service that listens on all addresses is reached on this machine's own.
        let host = if addr.ip().is_unspecified() { SocketAddr::from(([127, 0, 0, 1], addr.port())) } else { addr };
        Ok(Self { http, base: format!("http://{host}"), key: key.to_owned() })
    }

    async fn get(&self, path: &str) -> anyhow::Result<Value> {
        self.send(self.http.get(format!("{}{path}", self.base))).await
    }

    async fn post(&self, path: &str, body: &Value) -> anyhow::Result<Value> {
        self.send(self.http.post(format!("{}{path}", self.base)).json(body)).await
    }

    async fn upload(&self, path: &str, bytes: Vec<u8>) -> anyhow::Result<Value> {
        use sha2::{Digest, Sha256};
        let digest = hex::encode(Sha256::digest(&bytes));
        let request = self.http.post(format!("{}{path}", self.base));
        let request = request.header("content-type", "application/mcap").header("x-content-sha256", digest);
        self.send(request.body(bytes)).await
    }

    async fn send(&self, request: reqwest::RequestBuilder) -> anyhow::Result<Value> {
        let response = request.bearer_auth(&self.key).send().await?;
        let status = response.status();
        let body: Value = response.json().await.with_context(|| format!("{status} without JSON"))?;
        if !status.is_success() {
            bail!("{status}: {}", body["detail"].as_str().unwrap_or("no detail"));
        }
        Ok(body)
    }

    /// Follows a job to its end; returns the assessment's id.
    async fn follow(&self, job: &str) -> anyhow::Result<String> {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(0) } else { ProgressBar::hidden() };
        bar.set_style(ProgressStyle::with_template("   {msg:12} {bar:40} {pos}/{len}")?);
        loop {
            let state = self.get(&format!("/v1/jobs/{job}")).await?;
            let progress = &state["progress"];
            bar.set_message(progress["step"].as_str().unwrap_or_default().to_owned());
            bar.set_length(progress["total"].as_u64().unwrap_or(0));
            bar.set_position(progress["done"].as_u64().unwrap_or(0));
            match text(&state, "state")? {
                "done" => {
                    bar.finish_and_clear();
                    return Ok(text(&state, "assessment_id")?.to_owned());
                }
                "queued" | "running" => tokio::time::sleep(Duration::from_millis(50)).await,
                other => bail!("the job ended as {other}: {}", state["error"]),
            }
        }
    }
}

/// A text field of an answer.
fn text<'a>(value: &'a Value, field: &str) -> anyhow::Result<&'a str> {
    value[field].as_str().with_context(|| format!("the answer has no `{field}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn comparison(error: f64) -> Comparison {
        Comparison {
            channel: "left_knee_flexion_deg".into(),
            estimated_min_deg: 0.0,
            estimated_max_deg: 60.0,
            true_min_deg: 0.0,
            true_max_deg: 60.0,
            mean_absolute_error_deg: error,
            interval_coverage: 0.95,
            limit_deg: 5.0,
        }
    }

    #[test]
    fn the_demo_fails_when_one_channel_is_beyond_its_limit() {
        assert!(verdict(vec![comparison(1.0), comparison(4.9)]).is_ok());
        let error = verdict(vec![comparison(1.0), comparison(5.1)]).unwrap_err().to_string();
        assert!(error.contains("left_knee_flexion_deg"), "{error}");
    }

    #[test]
    fn a_channel_is_compared_sample_by_sample_with_the_truth() {
        let reference = crate::recording::ReferenceSeries {
            channel: "left_knee_flexion_deg".into(),
            time_ns: vec![0, 1_000_000_000],
            values: vec![0.0, 10.0],
            ..Default::default()
        };
        let channel = ChannelBody {
            channel: "left_knee_flexion_deg".into(),
            value: vec![Some(1.0), Some(7.0), None],
            low: vec![Some(-1.0), Some(6.0), None],
            high: vec![Some(3.0), Some(8.0), None],
        };
        let found = compare_channel(&reference, &channel, &[0.0, 0.5, 1.0], 5.0).unwrap();
        assert_eq!((found.mean_absolute_error_deg, found.interval_coverage), (1.5, 0.5));
        assert_eq!((found.estimated_max_deg, found.true_max_deg), (7.0, 5.0));
    }
}
