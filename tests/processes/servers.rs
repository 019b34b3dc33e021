//! Servers of the test's own: PostgreSQL, NATS, an S3 store. Where a program is absent its test says so and is skipped.

use crate::support::{PATIENCE, Process};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A port that is free now.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < PATIENCE, "{what} takes too long");
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn answers(port: u16) -> bool {
    std::net::TcpStream::connect(("127.0.0.1", port)).is_ok()
}

/// A cluster of PostgreSQL.
pub struct Postgres {
    folder: TempDir,
    programs: PathBuf,
    port: u16,
}

impl Postgres {
    /// None where PostgreSQL's programs are not installed or may not be run.
    pub fn start() -> Option<Self> {
        let versions = std::fs::read_dir("/usr/lib/postgresql").ok()?;
        let programs = versions
            .filter_map(|entry| Some(entry.ok()?.path().join("bin")))
            .find(|bin| bin.join("initdb").is_file())?;
        let one = Self { folder: tempfile::tempdir().unwrap(), programs, port: free_port() };
        // PostgreSQL does not run as root.
        Command::new("chown").arg("postgres").arg(one.folder.path()).status().ok()?;
        one.run("initdb", &["-A", "trust", "-U", "postgres", "--no-sync"])?;
        one.control("start")?;
        Some(one)
    }

    pub fn url(&self) -> String {
        format!("postgres://postgres@127.0.0.1:{}/postgres", self.port)
    }

    /// Ends it as a power cut does, and starts it again.
    pub fn crash(&self) {
        self.control("restart").expect("a restart");
    }

    fn control(&self, action: &str) -> Option<()> {
        let options = format!("-p {} -k {} -c listen_addresses=127.0.0.1", self.port, self.data().display());
        self.run("pg_ctl", &["-w", "-m", "immediate", "-l", "/dev/null", "-o", &options, action])
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn run(&self, program: &str, arguments: &[&str]) -> Option<()> {
        let is_root = Command::new("id").arg("-u").output().ok()?.stdout == b"0\n";
        let mut command = if is_root { Command::new("runuser") } else { Command::new(self.programs.join(program)) };
        if is_root {
            command.args(["-u", "postgres", "--"]).arg(self.programs.join(program));
        }
        command.arg("-D").arg(self.data()).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        command.current_dir(self.folder.path()).status().ok()?.success().then_some(())
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        let _ = self.control("stop");
    }
}

/// A NATS server that keeps its streams on the disk.
pub struct Nats {
    folder: TempDir,
    port: u16,
    process: Option<Process>,
}

impl Nats {
    /// None where the program is not installed.
    pub fn start() -> Option<Self> {
        let mut one = Self { folder: tempfile::tempdir().unwrap(), port: free_port(), process: None };
        one.run()?;
        Some(one)
    }

    pub fn url(&self) -> String {
        format!("nats://127.0.0.1:{}", self.port)
    }

    /// Kills it and starts it again after a while.
    pub fn crash(&mut self, pause: Duration) {
        self.process = None;
        std::thread::sleep(pause);
        self.run().expect("a restart");
    }

    fn run(&mut self) -> Option<()> {
        let port = self.port.to_string();
        let mut command = Command::new("nats-server");
        command.args(["-js", "-a", "127.0.0.1", "-p", &port, "-sd"]).arg(self.folder.path());
        self.process = Some(Process(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().ok()?));
        until("the start of NATS", || answers(self.port));
        Some(())
    }
}

/// An S3 store in memory: `moto` of Python.
pub struct Bucket {
    port: u16,
    _process: Process,
}

impl Bucket {
    /// None where Python has no `moto` with its server.
    pub fn start() -> Option<Self> {
        let has_server = Command::new("python3").args(["-c", "import moto.server"]).stderr(Stdio::null()).status();
        if !has_server.is_ok_and(|status| status.success()) {
            return None;
        }
        let port = free_port();
        let mut command = Command::new("python3");
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p", &port.to_string()]);
        let process = Process(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().ok()?);
        until("the start of moto", || answers(port));
        let one = Self { port, _process: process };
        let made = Command::new("python3").args(["-c", MAKE_BUCKET, &one.endpoint()]).status();
        made.is_ok_and(|status| status.success()).then_some(one)
    }

    fn endpoint(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    pub fn settings(&self) -> Vec<(String, String)> {
        let pairs = [
            ("SUREFOOT_BLOB_URL", "s3://recordings/clinic".to_owned()),
            ("AWS_ENDPOINT", self.endpoint()),
            ("AWS_ALLOW_HTTP", "true".to_owned()),
            ("AWS_REGION", "us-east-1".to_owned()),
            ("AWS_ACCESS_KEY_ID", "test".to_owned()),
            ("AWS_SECRET_ACCESS_KEY", "test".to_owned()),
        ];
        pairs.map(|(name, value)| (name.to_owned(), value)).into()
    }
}

const MAKE_BUCKET: &str = "
import sys, urllib.request
urllib.request.urlopen(urllib.request.Request(sys.argv[1] + '/recordings', method='PUT'))
";

/// True when no file of a folder or below is a blob.
pub fn holds_no_blob(data_dir: &Path) -> bool {
    std::fs::read_dir(data_dir.join("blobs")).is_ok_and(|mut entries| entries.next().is_none())
        || !data_dir.join("blobs").exists()
}
