package org.camssf.forms

/** The parts of a document, from Python's types. Made by `python -m tools.formats`; do not edit. */
internal const val FORM_TABLE: String = """
{
 "Document": {
  "format": {"is":"words","words":["camssf/2"]},
  "version": {"is":"text"},
  "capture": {"is":"part","name":"Capture","null":true,"default":null},
  "answer": {"is":"part","name":"Answer","null":true,"default":null},
  "verdict": {"is":"part","name":"Verdict","null":true,"default":null},
  "assumptions": {"is":"list","of":{"is":"part","name":"Assumption"},"least":0,"most":10000,"default":[]},
  "truth": {"is":"part","name":"Truth","null":true,"default":null},
  "sha256": {"is":"text","pattern":"[0-9a-f]{64}","words":"must be 64 hex digits","null":true,"default":null}
 },
 "Capture": {
  "shots": {"is":"list","of":{"is":"part","name":"MeasuredShot"},"least":0,"most":64},
  "chart": {"is":"part","name":"ChartTable"},
  "white_reflectance": {"is":"number","least":0.05,"most":1.2,"null":true,"default":null},
  "files": {"is":"map","key":{"is":"text"},"of":{"is":"text","pattern":"[0-9a-f]{64}","words":"must be 64 hex digits"},"default":{}},
  "unfinished": {"is":"part","name":"UnfinishedShot","null":true,"default":null}
 },
 "MeasuredShot": {
  "lamp": {"is":"either","of":{"named":{"is":"part","name":"Lamp"},"unnamed":{"is":"own","name":"Unnamed"}}},
  "photo": {"is":"part","name":"Photo"},
  "white": {"is":"part","name":"Photo","null":true},
  "dark": {"is":"part","name":"Photo","null":true},
  "pose": {"is":"part","name":"Pose"},
  "means": {"is":"part","name":"PatchMeans"},
  "lens_shading": {"is":"words","words":["as-stored","apply"],"default":"as-stored"}
 },
 "Lamp": {
  "name": {"is":"text"},
  "values": {"is":"array","sides":[681],"least":0.0},
  "tolerance": {"is":"number","least":0.0},
  "modes": {"is":"array","sides":[null,681],"fewest":0},
  "source": {"is":"text"},
  "tolerance_kelvin": {"is":"number","least":0.0,"null":true,"default":null}
 },
 "Photo": {
  "name": {"is":"text"},
  "width": {"is":"whole","least":1,"most":1000000000},
  "height": {"is":"whole","least":1,"most":1000000000},
  "orientation": {"is":"whole","least":1,"most":8},
  "exposure": {"is":"number","least":0.0,"null":true},
  "iso": {"is":"number","least":0.0,"null":true},
  "gain_map": {"is":"flag"},
  "make": {"is":"text"},
  "model": {"is":"text"},
  "sha256": {"is":"text","pattern":"[0-9a-f]{64}","words":"must be 64 hex digits"},
  "colour_matrices": {"is":"list","of":{"is":"part","name":"ColourMatrix"},"default":[]},
  "unit": {"is":"part","name":"Unit","default":{}},
  "active_area": {"is":"tuple","of":[{"is":"whole","least":0,"most":1000000000},{"is":"whole","least":0,"most":1000000000},{"is":"whole","least":0,"most":1000000000},{"is":"whole","least":0,"most":1000000000}],"null":true,"default":null},
  "levels": {"is":"text","default":""},
  "unique_model": {"is":"text","default":""},
  "matrices_left_out": {"is":"text","default":""},
  "time": {"is":"text","default":""}
 },
 "ColourMatrix": {
  "light": {"is":"words","words":["A","B","C","D55","D65","D75","D50"]},
  "values": {"is":"list","of":{"is":"number"},"least":9,"most":9}
 },
 "Unit": {
  "camera_id": {"is":"text","default":""},
  "serial": {"is":"text","default":""},
  "serial_check": {"is":"text","pattern":"([0-9a-f]{4})?","words":"must be 4 hex digits","default":""},
  "lens": {"is":"text","default":""},
  "focal_length": {"is":"number","least":1e-09,"null":true,"default":null},
  "aperture": {"is":"number","least":1e-09,"null":true,"default":null}
 },
 "Pose": {
  "layout": {"is":"text"},
  "corners": {"is":"array","sides":[4,2]},
  "patches": {"is":"array","sides":[null,4,2]},
  "quarter_turns": {"is":"whole","least":0,"most":3},
  "method": {"is":"words","words":["detected","by hand","simulated"]},
  "score": {"is":"number","least":-1.0,"most":1.0},
  "notes": {"is":"list","of":{"is":"text"},"default":[]}
 },
 "PatchMeans": {
  "chart": {"is":"part","name":"FrameMeans"},
  "white": {"is":"part","name":"FrameMeans","null":true},
  "dark": {"is":"part","name":"FrameMeans","null":true},
  "black": {"is":"array","sides":[3]},
  "saturation": {"is":"number","least":0.0},
  "evened": {"is":"flag","default":false}
 },
 "FrameMeans": {
  "mean": {"is":"array","sides":[null,3]},
  "standard_error": {"is":"array","sides":[null,3],"least":0.0},
  "count": {"is":"array","sides":[null,3],"least":1,"most":1000000000000000.0,"whole":true},
  "clipped": {"is":"array","sides":[null,3],"least":0.0,"most":1.0},
  "dead": {"is":"array","sides":[null,3],"least":0.0,"most":1.0},
  "gradient": {"is":"array","sides":[null,3]},
  "greens": {"is":"array","sides":[null,2]}
 },
 "ChartTable": {
  "name": {"is":"text"},
  "table": {"is":"text"},
  "layout": {"is":"own","name":"ChartLayout"},
  "patches": {"is":"list","of":{"is":"text"},"least":1,"most":1000},
  "wavelengths": {"is":"array","sides":[null],"least":0.0},
  "reflectance": {"is":"array","sides":[null,null],"least":0.0,"most":2.0},
  "tolerance": {"is":"array","sides":[null],"least":0.0,"most":0.5},
  "white": {"is":"whole","least":0,"most":1000000000},
  "source": {"is":"text"},
  "fading": {"is":"number","least":0.0,"most":1.0,"default":0.0}
 },
 "UnfinishedShot": {
  "lamp": {"is":"either","of":{"named":{"is":"part","name":"Lamp"},"unnamed":{"is":"own","name":"Unnamed"}}},
  "photo": {"is":"part","name":"Photo","null":true,"default":null},
  "black": {"is":"array","sides":[3],"null":true,"default":null},
  "saturation": {"is":"number","least":0.0,"default":0.0},
  "pose": {"is":"part","name":"Pose","null":true,"default":null}
 },
 "Answer": {
  "basis": {"is":"text"},
  "engine": {"is":"words","words":["onnx","reference"]},
  "curves": {"is":"part","name":"Curves"},
  "channel_gain": {"is":"array","sides":[3]},
  "gamma": {"is":"array","sides":[3],"least":0.0},
  "l2": {"is":"number","least":0.0},
  "proof": {"is":"part","name":"Proof"},
  "used": {"is":"list","of":{"is":"list","of":{"is":"flag"}}},
  "level": {"is":"array","sides":[null,null]},
  "predicted": {"is":"array","sides":[null,null,3]},
  "unseen": {"is":"array","sides":[null,null,3],"gaps":true},
  "scores": {"is":"part","name":"Scores"},
  "model": {"is":"text","pattern":"[0-9a-f]{64}","words":"must be 64 hex digits","null":true,"default":null},
  "basis_sha256": {"is":"text","pattern":"[0-9a-f]{64}","words":"must be 64 hex digits","null":true,"default":null},
  "std": {"is":"part","name":"Curves","null":true,"default":null},
  "code_covariance": {"is":"array","sides":[null],"null":true,"default":null},
  "evidence": {"is":"number","null":true,"default":null},
  "prior_scale": {"is":"number","least":0.0,"default":1.0},
  "chart_fading": {"is":"number","least":0.0,"most":1.0,"default":0.0},
  "choice": {"is":"list","of":{"is":"part","name":"Hypothesis"},"default":[]},
  "predicted_std": {"is":"array","sides":[null,null,3],"gaps":true,"null":true,"default":null},
  "unseen_std": {"is":"array","sides":[null,null,3],"gaps":true,"null":true,"default":null},
  "lights": {"is":"list","of":{"is":"part","name":"EstimatedLamp","null":true},"default":[]},
  "uncertainty": {"is":"part","name":"Uncertainty","null":true,"default":null}
 },
 "Curves": {
  "red": {"is":"array","sides":[681]},
  "green": {"is":"array","sides":[681]},
  "blue": {"is":"array","sides":[681]}
 },
 "Proof": {
  "gap": {"is":"array","sides":[3]},
  "layers_gap": {"is":"array","sides":[null]},
  "finish_steps": {"is":"array","sides":[null],"least":0,"whole":true}
 },
 "Scores": {
  "rmsre_percent": {"is":"array","sides":[3],"least":0.0},
  "unseen": {"is":"text"},
  "rmse": {"is":"array","sides":[3],"least":0.0,"null":true},
  "delta_e00": {"is":"number","least":0.0}
 },
 "Hypothesis": {
  "basis": {"is":"text"},
  "log_evidence": {"is":"number"},
  "probability": {"is":"number","least":0.0,"most":1.0},
  "kinds": {"is":"list","of":{"is":"text"},"default":[]}
 },
 "EstimatedLamp": {
  "kinds": {"is":"map","key":{"is":"text"},"of":{"is":"number","least":0.0,"most":1.0}},
  "power": {"is":"array","sides":[681]},
  "std": {"is":"array","sides":[681],"least":0.0},
  "kelvin": {"is":"number","least":0.0},
  "kelvin_std": {"is":"number","least":0.0}
 },
 "Uncertainty": {
  "half_width": {"is":"number","least":0.0},
  "half_width_without_photo": {"is":"number","least":0.0,"null":true},
  "alone": {"is":"list","of":{"is":"number","least":0.0}},
  "budget": {"is":"list","of":{"is":"part","name":"UncertaintySource"}}
 },
 "UncertaintySource": {
  "source": {"is":"text"},
  "size": {"is":"text"},
  "share": {"is":"array","sides":[3]}
 },
 "Verdict": {
  "status": {"is":"words","words":["accepted","doubtful","refused"]},
  "reasons": {"is":"list","of":{"is":"part","name":"Reason"},"default":[]},
  "checks": {"is":"list","of":{"is":"part","name":"Check"},"default":[]}
 },
 "Reason": {
  "code": {"is":"text"},
  "message": {"is":"text"},
  "advice": {"is":"text"},
  "value": {"is":"number","null":true,"default":null},
  "threshold": {"is":"number","null":true,"default":null},
  "key": {"is":"text","default":""},
  "arguments": {"is":"map","key":{"is":"text"},"of":{"is":"argument"},"default":{}}
 },
 "Check": {
  "name": {"is":"text"},
  "shot": {"is":"whole","least":1,"most":1000000000,"null":true},
  "value": {"is":"number"},
  "limit": {"is":"number"},
  "refuses": {"is":"number","null":true},
  "beyond": {"is":"words","words":["above","below"]}
 },
 "Assumption": {
  "code": {"is":"text"},
  "message": {"is":"text"}
 },
 "Truth": {
  "name": {"is":"text"},
  "curves": {"is":"part","name":"Curves"}
 }
}
"""
