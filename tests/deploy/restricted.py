"""Checks pods against the Pod Security Standard "restricted" of Kubernetes, and what offbd adds.

    python3 restricted.py MANIFEST...
"""

import sys

import yaml

# https://kubernetes.io/docs/concepts/security/pod-security-standards/#restricted
VOLUMES = {
    "configMap", "csi", "downwardAPI", "emptyDir", "ephemeral", "persistentVolumeClaim",
    "projected", "secret",
}
PROFILES = {"RuntimeDefault", "Localhost"}


def faults(pod):
    """Names what is not permitted, of a pod without Windows containers."""
    for key in ("hostNetwork", "hostPID", "hostIPC"):
        if pod.get(key):
            yield key
    for volume in pod.get("volumes", []):
        yield from (f"volume {volume['name']}: {key}" for key in volume.keys() - VOLUMES - {"name"})
    # Not part of the standard: no credentials of the API server, no writable image, and a start
    # that takes as long as the journal needs.
    if pod.get("automountServiceAccountToken") is not False:
        yield "automountServiceAccountToken"
    for container in pod.get("containers", []):
        if not container.get("securityContext", {}).get("readOnlyRootFilesystem"):
            yield f"{container['name']}: readOnlyRootFilesystem"
        if "startupProbe" not in container:
            yield f"{container['name']}: startupProbe"
    for kind in ("containers", "initContainers", "ephemeralContainers"):
        for container in pod.get(kind, []):
            for fault in faults_of(container, pod.get("securityContext", {})):
                yield f"{container['name']}: {fault}"


def faults_of(container, of_pod):
    own = container.get("securityContext", {})
    both = {**of_pod, **own}
    capabilities = own.get("capabilities", {})
    if own.get("privileged"):
        yield "privileged"
    if own.get("allowPrivilegeEscalation") is not False:
        yield "allowPrivilegeEscalation"
    if not both.get("runAsNonRoot") or both.get("runAsUser") == 0:
        yield "runs as root"
    if both.get("seccompProfile", {}).get("type") not in PROFILES:
        yield "seccompProfile"
    if capabilities.get("drop") != ["ALL"] or set(capabilities.get("add", [])) - {"NET_BIND_SERVICE"}:
        yield "capabilities"
    if own.get("procMount", "Default") != "Default":
        yield "procMount"
    if any(port.get("hostPort") for port in container.get("ports", [])):
        yield "hostPort"
    if both.get("sysctls"):
        yield "sysctls"


documents = [d for path in sys.argv[1:] for d in yaml.safe_load_all(open(path, encoding="utf-8"))]
pods = [d["spec"]["template"]["spec"] for d in documents if "template" in d["spec"]]
found = [fault for pod in pods for fault in faults(pod)]
if found or not pods:
    sys.exit(f"not restricted: {found}" if found else "no pods")
print(f"{len(pods)} kind of pod: restricted")
