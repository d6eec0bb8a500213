//! `grainspan watch` and `grainspan report`: what the server answers, what the file holds, and in a headless browser whether the page
//! draws it.

use crate::harness::Site;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

/// A small run that has ended, in the folder `run`.
fn ended_run(site: &Site, more: &[&str]) {
    let out = site.path("run");
    let words = ["run", "scenes/biaxial-small.toml", "--workers", "1", "--quiet", "--out", out.to_str().unwrap()];
    site.start("run", &[&words[..], more].concat()).end();
}

/// A server of the folder `run`; ended with the test.
struct Watch {
    child: Child,
    address: String,
}

impl Watch {
    fn start(site: &Site) -> Self {
        let folder = site.path("run");
        let mut child = site.program(&["watch", folder.to_str().unwrap()]).stdout(Stdio::piped()).spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { child, address: address.trim().to_owned() }
    }

    /// Status line and body of an answer; `path` is relative to the address.
    fn request(&self, method: &str, path: &str) -> (String, String) {
        let (host, base) = self.address.trim_start_matches("http://").split_once('/').unwrap();
        let mut stream = TcpStream::connect(host).unwrap();
        write!(stream, "{method} /{base}{path} HTTP/1.0\r\nHost: {host}\r\nContent-Length: 0\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let text = String::from_utf8_lossy(&answer).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        (head.lines().next().unwrap_or_default().to_owned(), body.to_owned())
    }

    fn json(&self, path: &str) -> serde_json::Value {
        let (status, body) = self.request("GET", path);
        assert!(status.contains("200"), "{path}: {status}");
        serde_json::from_str(&body).unwrap_or_else(|error| panic!("{path}: {error}: {body}"))
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The page as a browser has drawn it, or why there is no browser.
fn drawn(site: &Site, address: &str) -> Result<String, String> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = names.iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    let Some(browser) = found else { return Err(format!("none of {} is installed", names.join(", "))) };
    let profile = format!("--user-data-dir={}", site.path("profile").display());
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1280,800", "--virtual-time-budget=8000"])
        .args([&profile, "--dump-dom", address])
        .output()
        .unwrap();
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What every drawn page of the small run shows.
fn assert_drawn(page: &Result<String, String>) {
    let page = match page {
        Ok(page) => page,
        Err(reason) => {
            eprintln!("not looked at in a browser: {reason}");
            return;
        }
    };
    for part in [
        "data-ready=\"yes\"",
        "class=\"good\">done<",
        "class=\"uplot",
        "<option value=\"stress_ratio\">",
        "<option value=\"principal_stress_major\">",
        "class=\"strip\"",
        "of Gauss point 0",
        "100 grains",
        "grains to equilibrium",
    ] {
        assert!(
            page.contains(part),
            "{part} is missing in what the browser shows: {}",
            &page[..page.len().min(3000)]
        );
    }
    assert!(!page.contains("data-error"), "a script failed: {page}");
}

#[test]
fn the_server_answers_about_a_run_that_has_ended() {
    let site = Site::new();
    ended_run(&site, &[]);
    let watch = Watch::start(&site);
    assert!(watch.address.starts_with("http://127.0.0.1:"), "{}", watch.address);
    let state = watch.json("api/state");
    assert_eq!(state["status"], "done");
    assert_eq!(state["cells"].as_array().unwrap().len(), 32, "the last cells of all Gauss points");
    let history = watch.json("api/history");
    let column =
        |name: &str| history["columns"].as_array().unwrap().iter().find(|column| column["name"] == name).unwrap();
    assert_eq!(
        (column("top_force")["unit"].as_str(), column("stress_ratio")["unit"].as_str()),
        (Some("N/m"), Some("-"))
    );
    let errors = column("stress_ratio")["errors"].as_array().unwrap();
    assert!(errors.last().unwrap().as_f64().is_some_and(|error| error > 0.0), "an error band: {errors:?}");
    assert_eq!(watch.json("api/log")["steps"].as_array().unwrap().len(), 5);
    let frame = watch.json("api/frame?step=5&field=q");
    assert_eq!(frame["values"]["q"].as_array().unwrap().len(), 8);
    let cell = watch.json("api/cell?point=7&step=5");
    assert_eq!(cell["grains"].as_array().unwrap().len(), 100);
    assert!(watch.request("GET", "files/history.csv").1.starts_with("step,time"));
    for bad in ["files/../../secret", "files/%2e%2e/x", "../api/state", "api/none"] {
        assert!(watch.request("GET", bad).0.contains("404"), "{bad}");
    }
    assert!(watch.request("POST", "api/control?action=stop").0.contains("409"), "no run writes there now");
    // Files that are cut off at any place give answers, not the end of the server.
    for file in
        ["history.csv", "run.jsonl", "summary.json", "fields.pvd", "fields/step-0005.vtu", "units.json", "scene.toml"]
    {
        let path = site.path("run").join(file);
        let text = fs::read(&path).unwrap();
        for part in [0, 1, text.len() / 3, text.len() - 1] {
            fs::write(&path, &text[..part]).unwrap();
            for data in ["state", "history", "log", "mesh", "frame?step=5", "cell?point=0"] {
                watch.json(&format!("api/{data}"));
            }
        }
        fs::write(&path, &text).unwrap();
    }
    assert_drawn(&drawn(&site, &watch.address));
}

#[test]
fn the_report_is_one_file_that_a_browser_draws() {
    let site = Site::new();
    ended_run(&site, &[]);
    let output = site.program(&["report", site.path("run").to_str().unwrap()]).output().unwrap();
    assert!(output.status.success());
    let file = site.path("run/report.html");
    let page = fs::read_to_string(&file).unwrap();
    assert!(page.len() < 4_000_000, "{}", page.len());
    assert!(!page.contains("src=\"") && !page.contains("<link"), "the page needs no other file");
    assert_drawn(&drawn(&site, &format!("file://{}", file.display())));
    // A click on the upper right of the body shows the cell of a Gauss point there, one on the field another colour bar.
    let clicks = "<script>setTimeout(() => { const canvas = document.getElementById('mesh'), box = canvas.getBoundingClientRect(); \
                  canvas.dispatchEvent(new MouseEvent('click', { clientX: box.left + 0.66 * box.width, clientY: box.top + 0.07 * box.height })); \
                  const field = document.getElementById('field'); field.value = 'p'; field.dispatchEvent(new Event('change')); }, 3000);</script>";
    let clicked = site.path("run/clicked.html");
    fs::write(&clicked, page.replace("</body>", &format!("{clicks}</body>"))).unwrap();
    if let Ok(page) = drawn(&site, &format!("file://{}", clicked.display())) {
        for part in ["\">of Gauss point 30<", "<div class=\"name\">p, kPa</div>", "p of its element"] {
            assert!(page.contains(part), "{part} is missing after the clicks");
        }
    }
}

#[test]
fn the_report_of_a_run_without_a_step_says_why() {
    let site = Site::new();
    ended_run(&site, &["--set", "pressure.1.value=-1e5", "--set", "mesh.elements=[1, 1]"]);
    assert!(site.program(&["report", site.path("run").to_str().unwrap()]).output().unwrap().status.success());
    let file = site.path("run/report.html");
    match drawn(&site, &format!("file://{}", file.display())) {
        Ok(page) => {
            for part in ["not converged", "the packing has the stress", "No step was accepted", "data-ready=\"yes\""]
            {
                assert!(page.contains(part), "{part}: {}", &page[..page.len().min(3000)]);
            }
            assert!(!page.contains("data-error"));
        }
        Err(reason) => eprintln!("not looked at in a browser: {reason}"),
    }
}
