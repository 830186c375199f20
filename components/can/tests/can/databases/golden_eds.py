"""Objects of the data sheet as canopen reads them for node 5: python golden_eds.py > golden_eds.txt"""

import pathlib

import canopen

NODE = 5
path = pathlib.Path(__file__).parent / "motor.eds"
dictionary = canopen.import_od(str(path), node_id=NODE)
for index in sorted(dictionary):
    entry = dictionary[index]
    variables = [entry] if isinstance(entry, canopen.objectdictionary.ODVariable) else list(entry.values())
    for variable in sorted(variables, key=lambda variable: variable.subindex):
        limits = [variable.min, variable.max]
        writable = "rw" if "w" in variable.access_type else "ro"
        print(f"{index:04x} {variable.subindex} {writable} {variable.default}", *limits, variable.name, sep="|")
