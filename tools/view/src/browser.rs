//! A headless Chromium, controlled through its debugging protocol.

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use motorium::os::random_bytes;
use serde_json::{Value as Json, json};
use tungstenite::{Message, WebSocket};

/// Names of the program, in order of preference.
const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome", "chrome"];
/// Maximum time for the browser to start.
const START_WITHIN: Duration = Duration::from_secs(60);
/// Maximum time for an answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// Error of the browser: it is missing, does not start, or rejects a command.
#[derive(Debug, thiserror::Error)]
pub enum BrowserError {
    /// No browser is installed.
    #[error("no Chromium on PATH ({}); install it: `apt-get install chromium`", NAMES.join(", "))]
    Missing,
    /// The browser cannot be started.
    #[error("{} does not start: {reason}", .program.display())]
    Start {
        /// Path of the browser.
        program: PathBuf,
        /// Output of the browser, or the error of the operating system.
        reason: String,
    },
    /// The connection to the browser broke.
    #[error("the browser does not answer: {0}")]
    Connection(#[from] Box<tungstenite::Error>),
    /// The browser rejected a command, or the page threw an error.
    #[error("the browser refuses `{method}`: {reason}")]
    Refused {
        /// Name of the rejected command.
        method: String,
        /// Reason reported by the browser.
        reason: String,
    },
}

/// A page in a dedicated browser process, which ends when this value is dropped.
///
/// ```no_run
/// use motorium_view::browser::Browser;
///
/// let mut browser = Browser::open("http://localhost:8765/", (1280, 800))?;
/// assert_eq!(browser.evaluate("1 + 1")?, 2);
/// std::fs::write("page.png", browser.picture()?)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Browser {
    child: Child,
    profile: PathBuf,
    socket: WebSocket<TcpStream>,
    session: Option<String>,
    number: u64,
}

impl Browser {
    /// Returns the path of an installed browser, or `None` if no browser is installed.
    pub fn find() -> Option<PathBuf> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
        NAMES
            .iter()
            .find_map(|name| folders.iter().map(|folder| folder.join(name)).find(|file| file.is_file()))
    }

    /// Opens a page in a new browser, whose window has this width and height in pixels.
    ///
    /// # Errors
    /// No browser is installed, or the browser does not start.
    pub fn open(address: &str, (width, height): (u32, u32)) -> Result<Self, BrowserError> {
        let program = Self::find().ok_or(BrowserError::Missing)?;
        let failed = |reason: String| BrowserError::Start { program: program.clone(), reason };
        let io = |error: std::io::Error| failed(error.to_string());
        let name: String =
            random_bytes::<8>().map_err(io)?.iter().map(|byte| format!("{byte:02x}")).collect();
        let profile = std::env::temp_dir().join(format!("motorium-browser-{name}"));
        std::fs::DirBuilder::new().mode(0o700).create(&profile).map_err(io)?;
        let mut command = Command::new(&program);
        command
            .args(["--headless=new", "--remote-debugging-port=0", "--no-first-run", "--mute-audio"])
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"])
            // Only the robot needs GPU-style drawing; tables and plots are faster without.
            .args(["--disable-accelerated-2d-canvas", "--disable-gpu-rasterization"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--no-default-browser-check", "--hide-scrollbars", "--disable-dev-shm-usage"])
            // Pages of the browser's address bar would each start another process.
            .args(["--disable-extensions", "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg(format!("--window-size={width},{height}"))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        if rustix::process::geteuid().is_root() {
            // Its sandbox refuses to run as root.
            command.arg("--no-sandbox");
        }
        let mut child = command.spawn().map_err(io)?;
        let connected = endpoint(&mut child).map_err(failed).and_then(|endpoint| connect(&endpoint));
        let socket = match connected {
            Ok(socket) => socket,
            Err(error) => {
                end(&mut child, &profile);
                return Err(error);
            }
        };
        let mut browser = Self { child, profile, socket, session: None, number: 0 };
        let target = browser.order("Target.createTarget", json!({ "url": address }))?;
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = browser.order("Target.attachToTarget", attach)?;
        browser.session = session["sessionId"].as_str().map(str::to_string);
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        browser.order("Emulation.setDeviceMetricsOverride", size)?;
        Ok(browser)
    }

    /// Evaluates an expression in the page and returns its value. Promises are awaited.
    ///
    /// # Errors
    /// The page threw an error, or the browser does not answer.
    pub fn evaluate(&mut self, expression: &str) -> Result<Json, BrowserError> {
        let order = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut answer = self.order("Runtime.evaluate", order)?;
        if let Some(thrown) = answer.get("exceptionDetails") {
            let words = thrown["exception"]["description"].as_str().or(thrown["text"].as_str());
            let reason = words.unwrap_or("an error").to_string();
            return Err(BrowserError::Refused { method: expression.to_string(), reason });
        }
        Ok(answer["result"]["value"].take())
    }

    /// Takes a screenshot of the page as PNG.
    ///
    /// # Errors
    /// The browser cannot take a screenshot.
    pub fn picture(&mut self) -> Result<Vec<u8>, BrowserError> {
        let method = "Page.captureScreenshot";
        let answer = self.order(method, json!({ "format": "png" }))?;
        let data = answer["data"].as_str().and_then(|text| STANDARD.decode(text).ok());
        data.ok_or_else(|| BrowserError::Refused {
            method: method.to_string(),
            reason: "no picture".to_string(),
        })
    }

    /// Sends a command and waits for its answer.
    fn order(&mut self, method: &str, parameters: Json) -> Result<Json, BrowserError> {
        self.number += 1;
        let mut order = json!({ "id": self.number, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            order["sessionId"] = session.as_str().into();
        }
        self.socket.send(Message::text(order.to_string())).map_err(Box::new)?;
        loop {
            // Messages without the number are events.
            let Message::Text(text) = self.socket.read().map_err(Box::new)? else { continue };
            let Ok(mut answer) = serde_json::from_str::<Json>(&text) else { continue };
            if answer["id"] != self.number {
                continue;
            }
            if let Some(error) = answer.get("error") {
                let reason = error["message"].as_str().unwrap_or("an error").to_string();
                return Err(BrowserError::Refused { method: method.to_string(), reason });
            }
            return Ok(answer["result"].take());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        end(&mut self.child, &self.profile);
    }
}

fn end(child: &mut Child, profile: &Path) {
    let _ = child.kill();
    let _ = child.wait();
    // Its helper processes end later, and write to the folder until then.
    for _ in 0..50 {
        if std::fs::remove_dir_all(profile).is_ok() || !profile.exists() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Returns the address of the debugging protocol, which the browser prints on standard error.
fn endpoint(child: &mut Child) -> Result<String, String> {
    let errors = child.stderr.take().ok_or("it has no standard error")?;
    let (sender, lines) = mpsc::channel();
    // Read all lines: a full pipe would block the browser.
    std::thread::spawn(move || {
        for line in BufReader::new(errors).lines().map_while(Result::ok) {
            let _ = sender.send(line);
        }
    });
    let (began, mut said) = (Instant::now(), Vec::new());
    while let Ok(line) = lines.recv_timeout(START_WITHIN.saturating_sub(began.elapsed())) {
        if let Some((_, address)) = line.split_once("DevTools listening on ") {
            return Ok(address.trim().to_string());
        }
        said.push(line);
    }
    Err(if said.is_empty() { "it says nothing".to_string() } else { said.join("; ") })
}

fn connect(endpoint: &str) -> Result<WebSocket<TcpStream>, BrowserError> {
    let broken = |error: std::io::Error| Box::new(tungstenite::Error::Io(error));
    let host = endpoint.trim_start_matches("ws://").split('/').next().unwrap_or_default();
    let stream = TcpStream::connect(host).map_err(broken)?;
    stream.set_read_timeout(Some(ANSWER_WITHIN)).map_err(broken)?;
    stream.set_nodelay(true).map_err(broken)?;
    let (socket, _) = tungstenite::client(endpoint, stream).map_err(|error| {
        Box::new(match error {
            tungstenite::HandshakeError::Failure(error) => error,
            tungstenite::HandshakeError::Interrupted(_) => broken_off(),
        })
    })?;
    Ok(socket)
}

fn broken_off() -> tungstenite::Error {
    tungstenite::Error::Io(std::io::ErrorKind::TimedOut.into())
}
