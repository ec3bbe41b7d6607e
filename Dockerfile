# The server of anyprobe: docker build -t anyprobe . && docker run --read-only -p 8000:8000 anyprobe (docs/how-to/serve.md).

FROM python:3.13-slim AS build
WORKDIR /source
COPY pyproject.toml README.md LICENSE ./
COPY src ./src
RUN python -m venv /opt/anyprobe
RUN /opt/anyprobe/bin/pip install --no-cache-dir '.[serve,heic]'
RUN U2NET_HOME=/opt/anyprobe/share/anyprobe /opt/anyprobe/bin/anyprobe mask --fetch
RUN /opt/anyprobe/bin/python -m compileall -q /opt/anyprobe/lib

FROM python:3.13-slim
COPY --from=build /opt/anyprobe /opt/anyprobe
ENV PATH=/opt/anyprobe/bin:$PATH PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1
USER 10001:10001
WORKDIR /
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s --retries=3 \
  CMD ["python", "-P", "-S", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]
ENTRYPOINT ["anyprobe", "serve"]
CMD ["--host", "0.0.0.0", "--port", "8000"]
