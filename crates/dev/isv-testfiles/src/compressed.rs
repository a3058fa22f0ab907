//! Files that other programs compressed: a small uneven body by Draco and by meshoptimizer.

use super::gltf::Data;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// Rings of vertices between the poles of the body, and vertices of a ring.
const RINGS: usize = 4;
const SECTORS: usize = 7;

/// The body that all files of this module hold, as it was compressed: vertices and triangles. No two vertices are alike.
#[must_use]
pub fn body() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for ring in 1..=RINGS {
        let (height, width) = (TAU / 2.0 * ring as f64 / (RINGS + 1) as f64).sin_cos();
        for sector in 0..SECTORS {
            let (sin, cos) = (TAU * (sector as f64 + 0.1 * ring as f64) / SECTORS as f64).sin_cos();
            let (wide, lift) = (1.0 + 0.05 * ring as f64, 0.01 * sector as f64);
            vertices.push([height * cos * wide, 0.8 * height * sin + lift, 0.6 * width]);
        }
    }
    vertices.push([0.0, 0.0, -0.5]);
    let last = vertices.len() as u32 - 1;
    let at = |ring: usize, sector: usize| (1 + ring * SECTORS + sector % SECTORS) as u32;
    let mut triangles = Vec::new();
    for sector in 0..SECTORS {
        triangles.push([0, at(0, sector), at(0, sector + 1)]);
        for ring in 0..RINGS - 1 {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            triangles.extend([[a, c, b], [b, c, d]]);
        }
        triangles.push([at(RINGS - 1, sector), last, at(RINGS - 1, sector + 1)]);
    }
    (vertices, triangles)
}

/// Streams of `draco_encoder` (`-qp 14`), by how they code triangles: in sequence, by Edgebreaker, and by Edgebreaker with
/// valences.
pub const DRACO_STREAMS: [(&str, &str); 3] =
    [("sequential", DRACO_SEQUENTIAL), ("edgebreaker", DRACO_EDGEBREAKER), ("valence", DRACO_VALENCE)];

/// A GLB file with a Draco stream of [`DRACO_STREAMS`].
#[must_use]
pub fn draco(stream: &str) -> Vec<u8> {
    draco_stream(&STANDARD.decode(stream).unwrap())
}

/// A GLB file with the bytes of a Draco stream.
#[must_use]
pub fn draco_stream(stream: &[u8]) -> Vec<u8> {
    let mut data = Data::default();
    let view = data.view(stream);
    let (vertices, triangles) = body();
    let positions = json!({ "componentType": 5126, "type": "VEC3", "count": vertices.len() });
    let positions = data.accessor(positions);
    let indices = json!({ "componentType": 5125, "type": "SCALAR", "count": 3 * triangles.len() });
    let indices = data.accessor(indices);
    let extension = "KHR_draco_mesh_compression";
    let stream: Value = json!({ "bufferView": view, "attributes": { "POSITION": 0 } });
    data.glb(json!({
        "extensionsUsed": [extension],
        "extensionsRequired": [extension],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": positions },
            "indices": indices,
            "extensions": { extension: stream },
        }] }],
    }))
}

/// GLB files of gltfpack, by what they need: `-c -noq`, `-c -ce khr` and `-cc -vpf`.
#[must_use]
pub fn meshopt() -> [(&'static str, Vec<u8>); 3] {
    [
        ("EXT_meshopt_compression", MESHOPT_EXT),
        ("KHR_meshopt_compression and integers", MESHOPT_KHR),
        ("an exponential filter", MESHOPT_FILTER),
    ]
    .map(|(name, text)| (name, STANDARD.decode(text).unwrap()))
}

const DRACO_SEQUENTIAL: &str = "\
    RFJBQ08CAgEAAAA4HgEAAQIBAwICAwQDBQQEBQYFBwYGBwgHCQgAAgoCBAoKBAsEBgsLBgwGCAwMCA0ICQ0ACg4KCw4OCw8LDA8PDBAMDRAQDR\
    ENCREADhIODxISDxMPEBMTEBQQERQUERURCRUAEhYSExYWExcTFBcXFBgUFRgYFRkVCRkAFhoWFxoaFxsXGBsbGBwYGRwcGR0ZCR0AGgEaGwEB\
    GwMbHAMDHAUcHQUFHQcdCQcBAQAJAwAAAgABAQAPM2kmmRkGfMiNwgqIV7+q2l3Sk4ZCvFcIRSsAQEv3nwLpAIQFAQDE8Jbbsf5KQw8AoG5+wQ\
    PpUTNGAJDR6nY5yFsgOJj9ptG8AtlmmsOOBT6z8EBuLQmNkl6dcUSBrCD1Y8eq2dJyIM2UM0hJ75dfrEBKhZ+xY4GoazqQSFi+oaSriNRYIIkL\
    ANixxEI1Hkj5iQVR0mXraiqQ1MVn7NhhKMYOJAAAAAD/PwAAXrqJv4/CNb8AAAC/7FEIQA4=\
    ";

const DRACO_EDGEBREAKER: &str = "\
    RFJBQ08CAgEBAAAAHjgANwAADm+rbVWrpapUq1qqVFEKAQEQAf8AAAEACQMAAAIBAQEADyclAmkG8Q4dImkGCYs0j8aHraMfkmqWv2sOeEs3Cg\
    DAbjAuB8NFuDmyabASiQDgmAMAkvcTAUCKUD0ADL1U5oCrfHPssYbMoV0rFZHYZGVNQxbkgwMA6T43AAAHAQAAQI4AAIDQQ5sAAAAYVQAwOw8I\
    DQHKsq4h9v4rAQA0iFgAACBRNQKAr2idAQDi9D8A4C+IHgC+b5drSJtuLXYGZUpLvAcAAAAA/z8AAF66ib+PwjW/AAAAv+xRCEAO\
    ";

const DRACO_VALENCE: &str = "\
    RFJBQ08CAgEBAAAAHjgANwAADm+rbVWrpapUq1qqVFEKAQEQAf8AAQEACQMAAAIBAQEADydFBIkIrQpFJEUECQCM+raaEwjvlGqWv2sOeEs3Cg\
    DAbjAuB8NFuDmyabASiQDgmAMAkvcTAUCKUD0ADL1U5gDUAEAk8jkA0JAcgQYAC9oCAFieCIBF/eAAYPX+SgCgnaxmDg7Lk4nEh2FzGgIARhUA\
    zM4DQkP+ShGAhnkmakjAT2gAAAQccwDA3n8lAIAGEQsAACSqRgDwFa0zAAj6GGZnAAAAAP8/AABeuom/j8I1vwAAAL/sUQhADg==\
    ";

const MESHOPT_EXT: &str = "\
    Z2xURgIAAADkBQAAGAQAAEpTT057ImFzc2V0Ijp7InZlcnNpb24iOiIyLjAiLCJnZW5lcmF0b3IiOiJnbHRmcGFjayAxLjMifSwiZXh0ZW5zaW\
    9uc1VzZWQiOlsiRVhUX21lc2hvcHRfY29tcHJlc3Npb24iXSwiZXh0ZW5zaW9uc1JlcXVpcmVkIjpbIkVYVF9tZXNob3B0X2NvbXByZXNzaW9u\
    Il0sImJ1ZmZlcnMiOlt7ImJ5dGVMZW5ndGgiOjQzMn0seyJieXRlTGVuZ3RoIjo2OTYsImV4dGVuc2lvbnMiOnsiRVhUX21lc2hvcHRfY29tcH\
    Jlc3Npb24iOnsiZmFsbGJhY2siOnRydWV9fX1dLCJidWZmZXJWaWV3cyI6W3siYnVmZmVyIjoxLCJieXRlT2Zmc2V0IjowLCJieXRlTGVuZ3Ro\
    IjozNjAsImJ5dGVTdHJpZGUiOjEyLCJ0YXJnZXQiOjM0OTYyLCJleHRlbnNpb25zIjp7IkVYVF9tZXNob3B0X2NvbXByZXNzaW9uIjp7ImJ1Zm\
    ZlciI6MCwiYnl0ZU9mZnNldCI6MCwiYnl0ZUxlbmd0aCI6MzUyLCJieXRlU3RyaWRlIjoxMiwibW9kZSI6IkFUVFJJQlVURVMiLCJjb3VudCI6\
    MzB9fX0seyJidWZmZXIiOjEsImJ5dGVPZmZzZXQiOjM2MCwiYnl0ZUxlbmd0aCI6MzM2LCJ0YXJnZXQiOjM0OTYzLCJleHRlbnNpb25zIjp7Ik\
    VYVF9tZXNob3B0X2NvbXByZXNzaW9uIjp7ImJ1ZmZlciI6MCwiYnl0ZU9mZnNldCI6MzUyLCJieXRlTGVuZ3RoIjo3NywiYnl0ZVN0cmlkZSI6\
    MiwibW9kZSI6IlRSSUFOR0xFUyIsImNvdW50IjoxNjh9fX1dLCJhY2Nlc3NvcnMiOlt7ImJ1ZmZlclZpZXciOjAsImJ5dGVPZmZzZXQiOjAsIm\
    NvbXBvbmVudFR5cGUiOjUxMjYsImNvdW50IjozMCwidHlwZSI6IlZFQzMiLCJtaW4iOlstMS4wNzU5OTk5OCwtMC43MDk5OTk5NzksLTAuNV0s\
    Im1heCI6WzEuMDU0MDAwMDIsMC43MjAwMDAwMjksMV19LHsiYnVmZmVyVmlldyI6MSwiYnl0ZU9mZnNldCI6MCwiY29tcG9uZW50VHlwZSI6NT\
    EyMywiY291bnQiOjE2OCwidHlwZSI6IlNDQUxBUiJ9XSwibWVzaGVzIjpbeyJwcmltaXRpdmVzIjpbeyJhdHRyaWJ1dGVzIjp7IlBPU0lUSU9O\
    IjowfSwiaW5kaWNlcyI6MX1dfV0sIm5vZGVzIjpbeyJtZXNoIjowfV0sInNjZW5lcyI6W3sibm9kZXMiOlswXX1dLCJzY2VuZSI6MH0gsAEAAE\
    JJTgCgDwC3UWl2ajtz4iGsWXygxdePmOFGl4FmA7jqrym+ZgAADwDgt7tBvPaYeq8emhblHzA+bnlJbcFoVeHZcaSLZgAADwA63VV/i1Xua3Fa\
    u09RL3f1bRM00XTXcnuy1k1tlwAABwB+AQL+///9//79AwQAAwQP5/GQ/AT+hHoEDwBifbcUSeJVpiptBOgzgpAglLychUQjrBc4Dl9HZwAADw\
    AQa+JRC3ryN6PsVtddwD2wGovE6kn6HgW2/UQLZQAADwBYvXw3fhStzJCD8c3GygkNeZLdWQt+XFfKKsl+GgAABTgj8Pt6/v//////eTvMIP/+\
    e4P/BTPwwMAnj5CPkI8Aw88wkCgnj5CPBTPwwMCiPj0+PT4Aw88wPaGiPj0+BTPwwMDwiomKiYoAw88wiRAPiomKBRAAAAP/AAJAAAAAAAAAAA\
    AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAIA/4fAQIBASIJCAEvkicEARUBZAEaAHMaCAEWAR0BEgD0CgATAYUBHABjEwEvUBT/MPwAQywBEDAm8T\
    BgQUEQB2h1ZneKmGZYlomAFpAAAAAAA=\
    ";

const MESHOPT_KHR: &str = "\
    Z2xURgIAAACwBQAAjAQAAEpTT057ImFzc2V0Ijp7InZlcnNpb24iOiIyLjAiLCJnZW5lcmF0b3IiOiJnbHRmcGFjayAxLjMifSwiZXh0ZW5zaW\
    9uc1VzZWQiOlsiS0hSX21lc2hfcXVhbnRpemF0aW9uIiwiS0hSX21lc2hvcHRfY29tcHJlc3Npb24iXSwiZXh0ZW5zaW9uc1JlcXVpcmVkIjpb\
    IktIUl9tZXNoX3F1YW50aXphdGlvbiIsIktIUl9tZXNob3B0X2NvbXByZXNzaW9uIl0sImJ1ZmZlcnMiOlt7ImJ5dGVMZW5ndGgiOjI2NH0sey\
    JieXRlTGVuZ3RoIjo1NzYsImV4dGVuc2lvbnMiOnsiS0hSX21lc2hvcHRfY29tcHJlc3Npb24iOnsiZmFsbGJhY2siOnRydWV9fX1dLCJidWZm\
    ZXJWaWV3cyI6W3siYnVmZmVyIjoxLCJieXRlT2Zmc2V0IjowLCJieXRlTGVuZ3RoIjoyNDAsImJ5dGVTdHJpZGUiOjgsInRhcmdldCI6MzQ5Nj\
    IsImV4dGVuc2lvbnMiOnsiS0hSX21lc2hvcHRfY29tcHJlc3Npb24iOnsiYnVmZmVyIjowLCJieXRlT2Zmc2V0IjowLCJieXRlTGVuZ3RoIjox\
    ODEsImJ5dGVTdHJpZGUiOjgsIm1vZGUiOiJBVFRSSUJVVEVTIiwiY291bnQiOjMwfX19LHsiYnVmZmVyIjoxLCJieXRlT2Zmc2V0IjoyNDAsIm\
    J5dGVMZW5ndGgiOjMzNiwidGFyZ2V0IjozNDk2MywiZXh0ZW5zaW9ucyI6eyJLSFJfbWVzaG9wdF9jb21wcmVzc2lvbiI6eyJidWZmZXIiOjAs\
    ImJ5dGVPZmZzZXQiOjE4NCwiYnl0ZUxlbmd0aCI6NzcsImJ5dGVTdHJpZGUiOjIsIm1vZGUiOiJUUklBTkdMRVMiLCJjb3VudCI6MTY4fX19XS\
    wiYWNjZXNzb3JzIjpbeyJidWZmZXJWaWV3IjowLCJieXRlT2Zmc2V0IjowLCJjb21wb25lbnRUeXBlIjo1MTIzLCJjb3VudCI6MzAsInR5cGUi\
    OiJWRUMzIiwibWluIjpbMCwwLDBdLCJtYXgiOlsxNjM4MywxMDk5OSwxMTUzN119LHsiYnVmZmVyVmlldyI6MSwiYnl0ZU9mZnNldCI6MCwiY2\
    9tcG9uZW50VHlwZSI6NTEyMywiY291bnQiOjE2OCwidHlwZSI6IlNDQUxBUiJ9XSwibWVzaGVzIjpbeyJwcmltaXRpdmVzIjpbeyJhdHRyaWJ1\
    dGVzIjp7IlBPU0lUSU9OIjowfSwiaW5kaWNlcyI6MX1dfV0sIm5vZGVzIjpbeyJtZXNoIjowLCJ0cmFuc2xhdGlvbiI6Wy0xLjA3NTk5OTk4LC\
    0wLjcwOTk5OTk3OSwtMC41XSwic2NhbGUiOlswLjAwMDEzMDAxMjgyMSwwLjAwMDEzMDAxMjgyMSwwLjAwMDEzMDAxMjgyMV19XSwic2NlbmVz\
    IjpbeyJub2RlcyI6WzBdfV0sInNjZW5lIjowfSAIAQAAQklOAKH/pQD0hZewt38MFWSA3GpDBE1423Y8cfnen0m07DuQLAAkDypJKjdKUz45Gj\
    UIMBsfDjQyUQsSGAYeGjEcDQCGXQQbzGg8OIvA6/BjNSCEUvWXw1puwf8g+610wAACFg8UDAJDJh0GDSglEVQfJQ0SBhYUFxkOGBARIAA6kfEF\
    BgUGBTuQLQfl5ggHCAA6kR8REhESERUQLBESERIAAAAAAAAAAAAAAAAAAFQgVRURLQAAAAAAAADh8BAgEBIgkIAS+SJwQBFQFkARoAcxoIARYB\
    HQESAPQKABMBhQEcAGMTAS9QFP8w/ABDLAEQMCbxMGBBQRAHaHVmd4qYZliWiYAWkAAAAAAA==\
    ";

const MESHOPT_FILTER: &str = "\
    Z2xURgIAAACkBQAAYAQAAEpTT057ImFzc2V0Ijp7InZlcnNpb24iOiIyLjAiLCJnZW5lcmF0b3IiOiJnbHRmcGFjayAxLjMifSwiZXh0ZW5zaW\
    9uc1VzZWQiOlsiS0hSX21lc2hfcXVhbnRpemF0aW9uIiwiRVhUX21lc2hvcHRfY29tcHJlc3Npb24iXSwiZXh0ZW5zaW9uc1JlcXVpcmVkIjpb\
    IktIUl9tZXNoX3F1YW50aXphdGlvbiIsIkVYVF9tZXNob3B0X2NvbXByZXNzaW9uIl0sImJ1ZmZlcnMiOlt7ImJ5dGVMZW5ndGgiOjI5Nn0sey\
    JieXRlTGVuZ3RoIjo2OTYsImV4dGVuc2lvbnMiOnsiRVhUX21lc2hvcHRfY29tcHJlc3Npb24iOnsiZmFsbGJhY2siOnRydWV9fX1dLCJidWZm\
    ZXJWaWV3cyI6W3siYnVmZmVyIjoxLCJieXRlT2Zmc2V0IjowLCJieXRlTGVuZ3RoIjozNjAsImJ5dGVTdHJpZGUiOjEyLCJ0YXJnZXQiOjM0OT\
    YyLCJleHRlbnNpb25zIjp7IkVYVF9tZXNob3B0X2NvbXByZXNzaW9uIjp7ImJ1ZmZlciI6MCwiYnl0ZU9mZnNldCI6MCwiYnl0ZUxlbmd0aCI6\
    MjE4LCJieXRlU3RyaWRlIjoxMiwibW9kZSI6IkFUVFJJQlVURVMiLCJmaWx0ZXIiOiJFWFBPTkVOVElBTCIsImNvdW50IjozMH19fSx7ImJ1Zm\
    ZlciI6MSwiYnl0ZU9mZnNldCI6MzYwLCJieXRlTGVuZ3RoIjozMzYsInRhcmdldCI6MzQ5NjMsImV4dGVuc2lvbnMiOnsiRVhUX21lc2hvcHRf\
    Y29tcHJlc3Npb24iOnsiYnVmZmVyIjowLCJieXRlT2Zmc2V0IjoyMjAsImJ5dGVMZW5ndGgiOjczLCJieXRlU3RyaWRlIjoyLCJtb2RlIjoiVF\
    JJQU5HTEVTIiwiY291bnQiOjE2OH19fV0sImFjY2Vzc29ycyI6W3siYnVmZmVyVmlldyI6MCwiYnl0ZU9mZnNldCI6MCwiY29tcG9uZW50VHlw\
    ZSI6NTEyNiwiY291bnQiOjMwLCJ0eXBlIjoiVkVDMyIsIm1pbiI6Wy0xLjA3NTk4ODc3LC0wLjcwOTk5MTQ1NSwtMC41XSwibWF4IjpbMS4wNT\
    QwMTYxMSwwLjcyMDAwMTIyMSwxXX0seyJidWZmZXJWaWV3IjoxLCJieXRlT2Zmc2V0IjowLCJjb21wb25lbnRUeXBlIjo1MTIzLCJjb3VudCI6\
    MTY4LCJ0eXBlIjoiU0NBTEFSIn1dLCJtZXNoZXMiOlt7InByaW1pdGl2ZXMiOlt7ImF0dHJpYnV0ZXMiOnsiUE9TSVRJT04iOjB9LCJpbmRpY2\
    VzIjoxfV19XSwibm9kZXMiOlt7Im1lc2giOjB9XSwic2NlbmVzIjpbeyJub2RlcyI6WzBdfV0sInNjZW5lIjowfSAgKAEAAEJJTgCgDwCjZm1y\
    6lLtN182DB6SkEYhR6wRz35NLhjaSoqzEwAADwAmEQYnCB8EFQkmOiINNTEPJDwoCTUhDRQmHgMfBQAABQBAAgQIBCAAAA8AnxS0Yfo2r101du\
    JeJm8fQu2Q+pqofGF7PaBJE78AAA8ABC5VXm9OMRtSQAVFSSEgUEQCQUkpNDAsBiUrHTYAAAUBmSAQgEIBIAAFMADAA/XOUAAMADDO9QUwAMAD\
    IRMVAAwAABMBAAAAAQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAPMAAADyACAA8wAA4fAgIDAgMBEgEBMAFgAZABsAGgAZBgAQFwAXABcAFwAXAB\
    cGABAXABcAFwAXABcAFwYAAhMUFRYXAHaHVmd4qYZliWiYAWkAAAAAAA==\
    ";
