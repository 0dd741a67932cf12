//! Cost of viewers: ticks per second of a live run at full speed, without a viewer, with a page and with a
//! Foxglove client that has subscribed to every topic.
//!
//! Ticks are counted per second of CPU time of the run's thread, so that other programs disturb little;
//! the three cases take turns, and medians are printed.

use std::error::Error;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::json;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

const ROUNDS: usize = 15;
/// How long a case is measured in each round.
const MEASURED: Duration = Duration::from_secs(1);
const TICK_HZ: f64 = 1000.0;

#[derive(Clone, Copy)]
enum Viewer {
    None,
    Page,
    Foxglove,
}

struct Run {
    process: Child,
    port: u16,
}

impl Run {
    fn start() -> Result<Self, Box<dyn Error>> {
        let mut process = Command::new(env!("CARGO_BIN_EXE_painleve"))
            .args(["run", "--live", "0", "--no-token"])
            .stderr(Stdio::piped())
            .spawn()?;
        let mut line = String::new();
        let stderr = process.stderr.take().ok_or("no standard error")?;
        BufReader::new(stderr).read_line(&mut line)?;
        let port = line.split("ws://127.0.0.1:").nth(1).ok_or("no port")?;
        let port = port.split('/').next().unwrap_or_default().parse()?;
        Ok(Self { process, port })
    }

    fn connect(
        &self,
        path: &str,
        protocol: Option<&str>,
    ) -> Result<WebSocket<TcpStream>, Box<dyn Error>> {
        let stream = TcpStream::connect(("127.0.0.1", self.port))?;
        let url = format!("ws://127.0.0.1:{}{path}", self.port);
        let mut request = url.into_client_request()?;
        if let Some(protocol) = protocol {
            let headers = request.headers_mut();
            headers.insert("Sec-WebSocket-Protocol", protocol.parse()?);
        }
        Ok(tungstenite::client(request, stream)?.0)
    }

    /// Returns the number of ticks so far and the CPU time of the run's thread, s.
    fn ticks(&self) -> Result<(f64, f64), Box<dyn Error>> {
        let mut page = self.connect("/live", None)?;
        loop {
            // A row begins with its time.
            if let Message::Binary(rows) = page.read()?
                && let Some(time_s) = rows.first_chunk()
            {
                let id = self.process.id();
                let times = fs::read_to_string(format!("/proc/{id}/task/{id}/schedstat"))?;
                let spent_ns: f64 = times.split(' ').next().unwrap_or_default().parse()?;
                return Ok((f64::from_le_bytes(*time_s) * TICK_HZ, spent_ns * 1e-9));
            }
        }
    }

    /// Returns ticks per second of CPU time with this viewer.
    fn rate(&self, viewer: Viewer) -> Result<f64, Box<dyn Error>> {
        // The last viewer's thread has ended.
        std::thread::sleep(Duration::from_millis(100));
        let (first, start_s) = self.ticks()?;
        let mut socket = match viewer {
            Viewer::None => None,
            Viewer::Page => Some(self.connect("/live", None)?),
            Viewer::Foxglove => {
                let mut socket = self.connect("/", Some("foxglove.sdk.v1"))?;
                let topics: Vec<_> = (0..7)
                    .map(|id| json!({ "id": id, "channelId": id }))
                    .collect();
                let message = json!({ "op": "subscribe", "subscriptions": topics });
                socket.send(Message::text(message.to_string()))?;
                Some(socket)
            }
        };
        let start = Instant::now();
        let mut buffer = vec![0; 1 << 20];
        while start.elapsed() < MEASURED {
            match &mut socket {
                Some(socket) => {
                    let _ = socket.get_mut().read(&mut buffer)?;
                }
                None => std::thread::sleep(MEASURED),
            }
        }
        drop(socket);
        let (last, end_s) = self.ticks()?;
        Ok((last - first) / (end_s - start_s))
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // It runs until it is ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // `cargo test` starts benchmarks without --bench.
    if !std::env::args().any(|argument| argument == "--bench") {
        return Ok(());
    }
    let run = Run::start()?;
    let mut page = run.connect("/live", None)?;
    page.send(Message::text("{\"speed\":{\"factor\":0}}"))?;
    std::thread::sleep(MEASURED);
    drop(page);
    let viewers = [Viewer::None, Viewer::Page, Viewer::Foxglove];
    let mut rates = [const { Vec::new() }; 3];
    for _ in 0..ROUNDS {
        for (viewer, rates) in viewers.into_iter().zip(&mut rates) {
            rates.push(run.rate(viewer)?);
        }
    }
    let medians = rates.map(|mut rates| {
        rates.sort_by(f64::total_cmp);
        rates[rates.len() / 2]
    });
    for (name, median) in ["no viewer", "a page", "Foxglove, all topics"]
        .iter()
        .zip(medians)
    {
        let share = 100.0 * median / medians[0];
        println!("{name}: {median:.0} ticks per second of CPU time, {share:.1} %");
    }
    Ok(())
}
