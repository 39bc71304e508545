//! The program, run: sources, input files, options, exit codes, limits.

#![cfg(all(unix, feature = "libraries"))]

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Hooke's law in fixed form, with a line beyond column 72, a text of Abaqus and a module of another file. PROPS: E, ν, a factor of DDSDDE.
const LAW: &str = "      SUBROUTINE UMAT(STRESS,STATEV,DDSDDE,SSE,SPD,SCD,RPL,DDSDDT,DRPLDE,DRPLDT,STRAN,DSTRAN,TIME,DTIME,TEMP,
     1 DTEMP,PREDEF,DPRED,CMNAME,NDI,NSHR,NTENS,NSTATV,PROPS,NPROPS,COORDS,DROT,PNEWDT,CELENT,DFGRD0,DFGRD1,NOEL,NPT,LAYER,KSPT,KSTEP,KINC)
      USE FACTORS, ONLY: GAIN
      INCLUDE 'Aba_Param.Inc'
      CHARACTER*80 CMNAME
      DIMENSION STRESS(NTENS),STATEV(NSTATV),DDSDDE(NTENS,NTENS),DSTRAN(NTENS),PROPS(NPROPS)
      IF (CMNAME .NE. 'STEEL' .OR. ABS(STATEV(2) - 7.0D0) .GT. 1.0D0 .OR. TEMP .NE. 300.0D0) CALL XIT
      G = PROPS(1)/(2.0D0*(1.0D0 + PROPS(2)))
      ALAMBDA = PROPS(1)*PROPS(2)/((1.0D0 + PROPS(2))*(1.0D0 - 2.0D0*PROPS(2)))
      IF (NDI .EQ. 2) ALAMBDA = 2.0D0*G*ALAMBDA/(ALAMBDA + 2.0D0*G)
      DDSDDE = 0.0D0
      DDSDDE(1:NDI,1:NDI) = ALAMBDA
      DO I = 1, NTENS
        DDSDDE(I,I) = DDSDDE(I,I) + MERGE(2.0D0, 1.0D0, I .LE. NDI)*G
      END DO
      STRESS = STRESS + MATMUL(DDSDDE, DSTRAN)
      IF (PROPS(3) .GT. 2.0D0) WRITE(*,*) 'AGAIN AND AGAIN'
      DDSDDE = PROPS(3)*GAIN*DDSDDE
      END SUBROUTINE
";

const INPUT: &str = "*Heading
** *User Material, constants=1
*Parameter
nu = 0.3
*Material, name=Steel
*Depvar
2,
*User Material,
 constants=3
210D3, <nu>,
1.
*Initial Conditions, type=SOLUTION
all, 3.,
7.
*Initial Conditions, type=TEMPERATURE
nodes, 300.
";

/// A folder with the law; `None`, with a note, without gfortran.
fn folder(name: &str) -> Option<PathBuf> {
    if Command::new("gfortran").arg("--version").output().is_err() {
        std::io::stderr().write_all(b"\n*** NOT TESTED: the program, there is no gfortran ***\n").unwrap();
        return None;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("factors.f90"), "module factors\n  double precision :: gain = 1\nend module\n").unwrap();
    fs::write(folder.join("law.for"), LAW).unwrap();
    fs::write(folder.join("job.inp"), INPUT).unwrap();
    Some(folder)
}

fn run(folder: &Path, arguments: &str) -> (i32, String, String) {
    let program = env!("CARGO_BIN_EXE_tangent-check");
    let Output { status, stdout, stderr } =
        Command::new(program).args(arguments.split_whitespace()).current_dir(folder).output().unwrap();
    let [out, error] = [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    (status.code().unwrap_or(-1), out, error)
}

#[test]
fn sources_with_an_input_file() {
    let Some(folder) = folder("sources") else { return };
    let law = "factors.f90 law.for job.inp --tangent strain";
    for components in ["", "--plane-strain", "--plane-stress"] {
        let (code, out, error) = run(&folder, &format!("{law} {components}"));
        assert_eq!((code, error.as_str()), (0, ""), "{out}");
        assert!(out.starts_with("Tangent check of law.for\n"), "{out}");
        let (code, out, _) = run(&folder, &format!("{law} {components} --properties 210e3,0.3,-1"));
        assert!(code == 1 && out.contains("with the opposite sign"), "{out}");
    }
    // The law is small strain.
    assert_eq!(run(&folder, "factors.f90 law.for job.inp").0, 1);
    let left: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
}

#[test]
fn the_help_names_the_program_once_and_leaves_the_names_of_arguments() {
    let (code, help, _) = run(Path::new("."), "--help");
    assert!(code == 0 && help.contains("Usage: tangent-check FILE") && help.contains("--mfront NAME "), "{help}");
}

#[test]
fn prints_and_time_are_limited() {
    let Some(folder) = folder("limits") else { return };
    let law = "factors.f90 law.for job.inp --tangent strain --properties 210e3,0.3,3";
    let (code, _, error) = run(&folder, law);
    assert!(code == 1 && error.contains("[The law printed 65536 bytes; the rest"), "{}", error.len());
    assert!(error.len() < 70_000);
    let (code, out, _) = run(&folder, &format!("{law} --total-limit 1e-9 --states paths.json"));
    assert_eq!((code, out.as_str()), (2, ""), "no such file");
    let paths = r#"[{"name": "stretch", "length": 0.1, "gradients": [[[1.01, 0, 0], [0, 1, 0], [0, 0, 1]]]}]"#;
    fs::write(folder.join("paths.json"), paths).unwrap();
    let (code, out, _) = run(&folder, &format!("{law} --total-limit 1e-9 --states paths.json"));
    assert!(code == 2 && out.contains("The check lasts longer than 1ns"), "{out}");
    assert_eq!(run(&folder, &format!("{law} --states paths.json")).0, 1);
    fs::write(folder.join("paths.json"), paths.replace("1.01", "-1")).unwrap();
    let (_, _, error) = run(&folder, &format!("{law} --states paths.json"));
    assert!(error.contains("path \"stretch\", step 1: F needs a positive determinant"), "{error}");
}

/// Each mistake of a user is a sentence with exit code 2.
#[test]
fn mistakes() {
    let Some(folder) = folder("mistakes") else { return };
    fs::write(folder.join("two.inp"), format!("{INPUT}*Material, name=Brass\n*User Material, constants=1\n1.\n"))
        .unwrap();
    fs::write(folder.join("few.inp"), INPUT.replace("=3", "=4")).unwrap();
    fs::write(folder.join("text.inp"), INPUT.replace("<nu>", "<mu>")).unwrap();
    let mistakes = [
        ("", "There is no law"),
        ("--properties", "The option --properties needs a value"),
        ("law.for --state=y=x", "the value of y must be a finite number. `tangent-check --help`"),
        ("law.for --properties=1,nan", "it must be a finite number"),
        ("law.for --tangent piola", "jaumann-kirchhoff, jaumann-cauchy and strain are allowed"),
        ("law.for --report=pdf", "There is no report format \"pdf\". Allowed are: terminal,"),
        ("law.for --allow wrong", "only `inexact` can be allowed"),
        ("law.for --umat=1", "The option --umat takes no value"),
        ("law.for --weather 1", "there is no such option"),
        ("law.for --umat --c mine", "The options --umat and --c exclude each other."),
        ("law.for --mfront N --state 1", "The option --state is for UMATs alone."),
        ("law.for --external T=1", "The option --external is for MFront alone."),
        ("law.for libmine.so", "give one of both"),
        ("one.inp two.inp", "are two files of a kind"),
        ("law.for", "Cannot open module file"),
        ("missing.f", "missing.f: No such file"),
        ("factors.f90", "it has no symbol umat_, umat, UMAT."),
        ("factors.f90 law.for few.inp", "few.inp: *USERMATERIAL, CONSTANTS=4, but 3 numbers follow."),
        (
            "factors.f90 law.for two.inp",
            "two.inp: 2 user materials fit. Choose one with --name; there are: Steel, Brass.",
        ),
        ("factors.f90 law.for job.inp --name Gold", "0 user materials fit"),
        ("factors.f90 law.for text.inp", "text.inp: *USERMATERIAL, line 10: `<MU>` is not a number."),
        ("factors.f90 law.for --state 2", "XIT of Abaqus"),
    ];
    for (arguments, sentence) in mistakes {
        let (code, out, error) = run(&folder, arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments}: {error}");
        assert!(error.contains(sentence), "{arguments}: {error}");
    }
    let (code, out, _) = run(&folder, "--help");
    assert!(
        code == 0 && out.contains("Usage: tangent-check FILE…") && out.lines().all(|line| line.chars().count() < 150)
    );
}
