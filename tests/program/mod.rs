//! Runs the program in a folder of its own.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::{
    path::PathBuf,
    process::{Command, Output, Stdio},
};

/// A folder with the scene `room.gltf`, gone at the end.
pub struct Folder(tempfile::TempDir);

/// What the program said.
pub struct Said {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Folder {
    pub fn new() -> Self {
        let folder = Folder(tempfile::tempdir().unwrap());
        std::fs::write(folder.path("room.gltf"), room()).unwrap();
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Names of the files in it, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_luxel"));
        command.args(arguments.split_whitespace()).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    /// Runs `luxel` with these arguments, separated by spaces.
    pub fn luxel(&self, arguments: &str) -> Said {
        Said::by(self.command(arguments))
    }

    /// Likewise, with at most so many kilobytes of address space.
    #[cfg(target_os = "linux")]
    pub fn confined(&self, kilobytes: u32, arguments: &str) -> Said {
        let mut shell = Command::new("sh");
        let luxel = env!("CARGO_BIN_EXE_luxel");
        shell.args(["-c", &format!("ulimit -v {kilobytes}; exec '{luxel}' {arguments}")]).current_dir(self.0.path());
        Said::by(shell)
    }
}

impl Said {
    fn by(mut command: Command) -> Self {
        let Output { status, stdout, stderr } = command.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Said { code: status.code().unwrap_or(-1), out: text(stdout), err: text(stderr) }
    }
}

/// A floor of two triangles, a ceiling lamp, a camera.
fn room() -> String {
    let corners: [[f32; 3]; 8] = [
        [-2.0, 0.0, -2.0],
        [-2.0, 0.0, 2.0],
        [2.0, 0.0, 2.0],
        [2.0, 0.0, -2.0],
        [-0.5, 2.0, -0.5],
        [0.5, 2.0, -0.5],
        [0.5, 2.0, 0.5],
        [-0.5, 2.0, 0.5],
    ];
    let mut bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let hex: String = bytes.iter().map(|b| format!("%{b:02x}")).collect();
    let uri = format!("data:application/octet-stream,{hex}");
    let length = bytes.len();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1,2]}}],
        "nodes":[{{"name":"Floor","mesh":0}},{{"name":"Lamp","mesh":1}},{{"name":"Eye","camera":0,"translation":[0,1,5]}}],
        "cameras":[{{"name":"Main","type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}}}},
                     {{"pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}},"emissiveFactor":[1,1,1]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":2,"material":0}}]}},
                  {{"primitives":[{{"attributes":{{"POSITION":1}},"indices":2,"material":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-2,0,-2],"max":[2,0,2]}},
                     {{"bufferView":0,"byteOffset":48,"componentType":5126,"count":4,"type":"VEC3",
                       "min":[-0.5,2,-0.5],"max":[0.5,2,0.5]}},
                     {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":12}}],
        "buffers":[{{"uri":"{uri}","byteLength":{length}}}]}}"#
    )
}
