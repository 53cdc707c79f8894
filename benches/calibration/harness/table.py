def read(p):
    import json
    return [json.loads(l) for l in p.read_text().splitlines()] if p.exists() else []
def write(*a): return "",""
