
/// Tests that the release suite shares name the crate as it does.

pub mod cell;
pub mod contact;
pub mod definition;
pub mod engine;
pub mod error;
pub mod homogenization;
pub mod preparation;
pub mod programs;
pub mod server;
pub mod simd;
pub mod solver;
pub mod space;
pub mod tangent;
use crate::programs::rve_test::*;
use protocol::TangentKind;

fn main() {
    for case in std::fs::read_to_string("/tmp/bt/t/cases").unwrap().lines() {
        let (name, kind) = case.split_once(' ').unwrap();
        let kind = TangentKind::ALL.into_iter().find(|k| k.keyword() == kind).unwrap();
        let text = std::fs::read_to_string(format!("/tmp/bt/t/{name}.toml")).unwrap();
        let test = ElementTest::from_toml(&text).unwrap();
        let mut out = Vec::new();
        let start = std::time::Instant::now();
        {
            let mut csv = ElementCsv::new(&mut out, kind).unwrap();
            run_element(&test, std::path::Path::new("/tmp/bt/t"), kind, &mut |row| csv.write(row).unwrap()).unwrap();
        }
        eprintln!("{case} {:.2}", start.elapsed().as_secs_f64());
        std::fs::write(format!("/tmp/bt/new_csv/{name}.{}.csv", kind.keyword()), out).unwrap();
    }
}
