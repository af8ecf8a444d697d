//! Bakes every .glb of a folder with the built program; prints seconds, peak memory and exit code of each.
//!
//!     cargo build --release && cargo run --release --example scenes -- FOLDER [OPTION...]
//!
//! OPTIONs go to `luxel bake`, after `--resolution 512`. Where node is installed the Khronos validator compares each
//! output with its input. Exit 1 if a bake or a comparison failed.

use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio, exit},
    time::Instant,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let Some(folder) = words.next() else {
        eprintln!("usage: scenes FOLDER [OPTION...]");
        exit(2);
    };
    let options: Vec<String> = words.collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let luxel = built(&std::env::current_exe()?).ok_or("build the program first: cargo build --release")?;
    let has_node = Command::new("node").arg("--version").stdout(Stdio::null()).status().is_ok_and(|s| s.success());
    let out = tempfile::tempdir()?;
    let mut scenes: Vec<PathBuf> = fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    scenes.retain(|p| p.extension().is_some_and(|e| e == "glb") && !p.to_string_lossy().ends_with(".lit.glb"));
    scenes.sort();

    let mut failed = false;
    println!("{:40} {:>8} {:>8} {:>5} validator", "scene", "seconds", "peak MB", "exit");
    for scene in &scenes {
        let (baked, report) = (out.path().join("out.glb"), out.path().join("report.json"));
        [&baked, &report].into_iter().for_each(|file| drop(fs::remove_file(file)));
        let start = Instant::now();
        let status = Command::new(&luxel)
            .arg("bake")
            .args([scene.as_os_str(), "-o".as_ref(), baked.as_os_str()])
            .args(["--resolution", "512", "--quiet", "--report"])
            .arg(&report)
            .args(&options)
            .stdout(Stdio::null())
            .status()?;
        let seconds = start.elapsed().as_secs_f64();
        let memory = peak(&report).map_or("-".into(), |mb| mb.to_string());
        let exit = status.code().map_or("killed".into(), |c| c.to_string());
        let verdict = match (status.success(), has_node) {
            (true, true) => valid(root, scene, &baked)?,
            _ => "-".into(),
        };
        let name = scene.file_name().unwrap_or_default().to_string_lossy();
        println!("{name:40} {seconds:8.1} {memory:>8} {exit:>5} {verdict}");
        failed |= !status.success() || verdict.contains('\n');
    }
    exit(i32::from(failed))
}

/// The program, two folders above this example's.
fn built(example: &Path) -> Option<PathBuf> {
    let program = example.parent()?.parent()?.join(format!("luxel{}", std::env::consts::EXE_SUFFIX));
    program.exists().then_some(program)
}

fn peak(report: &Path) -> Option<u64> {
    let report: serde_json::Value = serde_json::from_slice(&fs::read(report).ok()?).ok()?;
    report["peak_memory_mb"].as_u64()
}

/// "ok", or what the validator has against `after`, on lines of their own.
fn valid(root: &Path, before: &Path, after: &Path) -> Result<String, Box<dyn Error>> {
    let script = root.join("tools/validator.mjs");
    let found = Command::new("node").arg(script).arg("--compare").args([before, after]).output()?;
    Ok(if found.status.success() {
        "ok".into()
    } else {
        format!("FAILED\n{}{}", String::from_utf8_lossy(&found.stdout), String::from_utf8_lossy(&found.stderr))
    })
}
